"""HTTP routes of analyses."""

from fastapi import APIRouter

from advice.body import Body
from advice.model_export import Script
from service.access import Viewer
from service.analysis import actions
from service.analysis.schemas import (
    AnalyseLoop,
    AnalyseLoops,
    AnalysisBody,
    ExportModel,
    InteractionBody,
    LoopsBody,
    RegionBody,
    RelateLoops,
    ScriptBody,
    SpecifyResponse,
)
from service.audit import declares
from service.limits import HEAVY

router = APIRouter(prefix="/v1", tags=["analysis"])


@router.post(
    "/analysis", response_model=AnalysisBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def analyse_loop(body: AnalyseLoop, _: Viewer) -> Body:
    """Analyse a process with a controller: responses, margins, poles, locus, limits, figures."""
    return actions.analyse_loop(body)


@router.post(
    "/analysis/batch", response_model=LoopsBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def analyse_loops(body: AnalyseLoops, _: Viewer) -> Body:
    """Find the margins of many loops in one request, stated and answered as columns."""
    return actions.analyse_loops(body)


@router.post(
    "/analysis/export",
    response_model=ScriptBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def export_process(body: ExportModel, _: Viewer) -> Script:
    """Write a process model as a short script for another tool."""
    return actions.export_process(body)


@router.post(
    "/analysis/pole-regions",
    response_model=RegionBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def specify_response(body: SpecifyResponse, _: Viewer) -> Body:
    """Turn a specification of the step response into a region for the poles, and poles back."""
    return actions.region_of(body)


@router.post(
    "/analysis/interactions",
    response_model=InteractionBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def relate_loops(body: RelateLoops, _: Viewer) -> Body:
    """Find the relative gains of a plant, and the pairing that interacts least."""
    return actions.relate_loops(body)
