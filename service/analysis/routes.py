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
    LoopsBody,
    ScriptBody,
)
from service.audit import declares

router = APIRouter(prefix="/v1", tags=["analysis"])


@router.post("/analysis", response_model=AnalysisBody, openapi_extra=declares(None))
def analyse_loop(body: AnalyseLoop, _: Viewer) -> Body:
    """Analyse a process with a controller: responses, margins, poles, locus, limits, figures."""
    return actions.analyse_loop(body)


@router.post("/analysis/batch", response_model=LoopsBody, openapi_extra=declares(None))
def analyse_loops(body: AnalyseLoops, _: Viewer) -> Body:
    """Find the margins of many loops in one request, stated and answered as columns."""
    return actions.analyse_loops(body)


@router.post("/analysis/export", response_model=ScriptBody, openapi_extra=declares(None))
def export_process(body: ExportModel, _: Viewer) -> Script:
    """Write a process model as a short script for another tool."""
    return actions.export_process(body)
