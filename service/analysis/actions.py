"""What users ask about a process with a controller; nothing is stored."""

from dataclasses import fields

import numpy as np

from advice.analyse import analyse
from advice.analysis_body import analysis_body
from advice.body import Body, numbers
from advice.interaction import interaction_body, interaction_case
from advice.model_export import Script, export_model
from advice.pole_region import Specification, region_body, region_case
from loop.batch import MarginBatch, PIDBatch, ProcessBatch
from loop.margin_batch import batch_margins
from service.analysis.schemas import (
    MOST_LOOPS,
    AnalyseLoop,
    AnalyseLoops,
    ExportModel,
    RelateLoops,
    SpecifyResponse,
    column,
)
from service.errors import InvalidRequest
from service.models.schemas import stated_process


def analyse_loop(wanted: AnalyseLoop) -> Body:
    """Say everything of one loop.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    """
    try:
        process = stated_process(wanted.process)
        analysis = analyse(
            process,
            wanted.controller.settings(process),
            compensators=[item.made() for item in wanted.compensators],
            scan_time=wanted.scan_time,
            profile=wanted.profile,
            task=None if wanted.task is None else wanted.task.task(),
            points=wanted.points,
            pade_order=wanted.pade_order,
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return analysis_body(analysis, figures=wanted.figures)


def export_process(wanted: ExportModel) -> Script:
    """Write a process model as a script.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    """
    try:
        process = stated_process(wanted.process)
        return export_model(process, wanted.target, sample_time=wanted.sample_time)
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error


def region_of(wanted: SpecifyResponse) -> Body:
    """Turn a specification of the step response into a region for the poles.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    """
    poles = [complex(pole.real, pole.imag) for pole in wanted.poles]
    try:
        specification = Specification(**wanted.model_dump(exclude={"poles"}))
        return region_body(region_case(specification, poles))
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error


def relate_loops(wanted: RelateLoops) -> Body:
    """Find the relative gains of a plant.

    Raises
    ------
    InvalidRequest
        The gains are not a square of numbers.
    RuleNotApplicable
        They are singular.
    """
    try:
        return interaction_body(interaction_case(wanted.gains))
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error


def analyse_loops(wanted: AnalyseLoops) -> Body:
    """Find the margins of many loops at once.

    Raises
    ------
    InvalidRequest
        A number cannot be, or columns differ in length.
    """
    p, c = wanted.process, wanted.controller
    K = column(p.K)
    try:
        shape = np.broadcast_shapes(
            *(
                column(values).shape
                for values in (p.K, p.theta, p.tau1, p.tau2, c.Kc, c.Td, c.N, c.tauF, c.Ti or 0.0)
            )
        )
    except ValueError as error:
        detail = f"All columns must be equally long, of 1 to {MOST_LOOPS} rows."
        raise InvalidRequest("body", detail) from error
    try:
        processes = ProcessBatch(
            K=np.broadcast_to(K, shape),
            tau1=column(p.tau1),
            tau2=column(p.tau2),
            integrators=np.asarray(p.integrators),
            theta=column(p.theta),
        )
        controllers = PIDBatch(
            Kc=column(c.Kc),
            Ti=np.asarray(np.inf) if c.Ti is None else column(c.Ti),
            Td=column(c.Td),
            N=column(c.N),
            tauF=column(c.tauF),
            sign=np.where(K < 0, -1.0, 1.0),
        )
        found = batch_margins(processes, controllers, sample_time=wanted.scan_time)
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    body: Body = {"count": int(found.stable.size)}
    for item in fields(MarginBatch):
        values = np.ravel(getattr(found, item.name))
        body[item.name] = values.tolist() if values.dtype == bool else numbers(values)
    return body
