"""The scenes that ship with the service."""

from __future__ import annotations

from functools import cache

from fastapi import APIRouter

from service.json_body import JsonRoute
from service.schemas import SampleList, SampleScene
from solver.document.samples import load_sample, sample_names

router = APIRouter(prefix="/v1", tags=["scenes"], route_class=JsonRoute)


@router.get("/scenes")
def list_scenes() -> SampleList:
    """The scenes that ship with the service: give a name as `sample` to open a session on one."""
    return _samples()


@cache
def _samples() -> SampleList:
    return SampleList(scenes=[_describe(name) for name in sample_names()])


def _describe(name: str) -> SampleScene:
    scene = load_sample(name)
    return SampleScene(
        name=name,
        objects=len(scene.objects),
        polygons=sum(len(o.mesh.faces) for o in scene),
        cameras=list(scene.cameras),
    )
