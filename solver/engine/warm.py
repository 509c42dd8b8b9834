"""Everything that a session may call, called once on tiny scenes, so that no client waits for a compiler.

Kernels are compiled for the types they are called with and kept on disk beside their sources. What is
compiled already is loaded, which takes a second or two in all: workers do that before they take a
session. The scenes are chosen for the paths that light takes through the code: closed and open, grey
and coloured, quadrilaterals and triangles, full, partial and no visibility, emitters and none, edits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from solver.document.edits import MoveEdit, RemoveEdit, SetMaterialEdit
from solver.document.models import MaterialDocument, TransformDocument
from solver.engine.drawing import Drawing, encode
from solver.engine.engine import Engine
from solver.engine.lightmaps.bake import LightmapRequest
from solver.engine.lightmaps.files import LightmapFormat, encode_lightmap
from solver.engine.overlays.backprojection import BackprojectionOverlay
from solver.engine.overlays.base import OverlayRequest
from solver.engine.overlays.places import Pixel
from solver.engine.overlays.probe import ProbeOverlay
from solver.engine.requests import (
    CameraChoice,
    Encoding,
    FrameRequest,
    LayerName,
    NotAvailableError,
    RendererName,
)
from solver.engine.world import World
from solver.geometry.scene import Camera, Material, Mesh, Scene, SceneObject
from solver.illumination.meshing.cells import Cells, ConstraintEdges
from solver.illumination.meshing.triangulation import triangulate
from solver.illumination.points.point_irradiance import PointIrradiance
from solver.illumination.settings import LightSettings
from solver.pathtracing import PathTracer
from solver.rendering.encoding import LinearFormat, PictureFormat
from solver.rendering.tessellation import Tessellator
from solver.rendering.tone_mapping import ToneCurve
from solver.transport.solve import RadiositySolver

_SLICE: Final = 1.0
_SETTINGS: Final = LightSettings(error_tolerance=0.03)
"""Reached by some rounds of refinement, so that links are split, resampled and inherited."""

_FEW_PATHS: Final = replace(_SETTINGS, max_paths=64, vpl_resolution=8)
"""Frames by virtual lights that are soon done."""

_GREY: Final = (0.5, 0.5, 0.5)
_RED: Final = (0.6, 0.3, 0.2)
_DARK: Final = (0.0, 0.0, 0.0)
_LIGHT: Final = (9.0, 9.0, 9.0)
_WARM_LIGHT: Final = (9.0, 8.0, 6.0)

_CUBE: Final = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
_INWARD: Final = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6))
_MOVE: Final = MoveEdit(op="move", id="screen", transform=TransformDocument(translation=[0.0, 0.1, 0.0]))
"""Floor, ceiling, then the walls, seen from inside."""

_Colour = tuple[float, float, float]


@dataclass(frozen=True)
class WarmStep:
    """One part of the warming up."""

    name: str
    """Told to people."""
    run: Callable[[], object]


def warm_up(drawing: Drawing) -> None:
    """Call everything once. Where `drawing` cannot draw here, that part is left out."""
    for step in warm_steps(drawing):
        step.run()


def warm_steps(drawing: Drawing) -> tuple[WarmStep, ...]:
    """The parts of `warm_up`, to be run in their order by the thread that made `drawing`."""
    return (
        WarmStep("solve a closed grey room", lambda: _solve(_room(_GREY, _LIGHT, range(6)))),
        WarmStep("solve an open coloured one", lambda: _solve(_room(_RED, _WARM_LIGHT, range(5)))),
        WarmStep("solve without light", lambda: _solve(_room(_GREY, _DARK, range(6)))),
        WarmStep("edit and probe", lambda: _edit(drawing)),
        WarmStep("mesh", _mesh),
        WarmStep("draw", lambda: _draw(drawing)),
        WarmStep("draw mirrors and gloss", lambda: _reflect(drawing)),
        WarmStep("follow links", _follow_links),
        WarmStep("bake", _bake),
        WarmStep("encode", _encode),
        WarmStep("trace paths", _trace),
    )


def _room(reflectance: _Colour, emission: _Colour, faces: range) -> Scene:
    """Walls of a unit cube, a lamp, a two-sided screen in the middle, and a table of a concave face."""
    white = Material(np.array(reflectance), np.zeros(3))
    objects = (
        SceneObject("walls", Mesh(_CUBE, tuple(_INWARD[k] for k in faces)), white),
        SceneObject(
            "lamp",
            Mesh(np.array([[0.4, 0.4, 0.9], [0.4, 0.6, 0.9], [0.6, 0.6, 0.9]]), ((0, 1, 2),)),
            Material(np.zeros(3), np.array(emission)),
        ),
        SceneObject(
            "screen",
            Mesh(
                np.array([[0.3, 0.5, 0.1], [0.7, 0.5, 0.1], [0.7, 0.5, 0.6], [0.3, 0.5, 0.6]]),
                ((0, 1, 2, 3),),
            ),
            Material(np.array(reflectance), np.zeros(3), two_sided=True),
        ),
        SceneObject(
            "table",
            Mesh(
                np.array(
                    [[0.1, 0.1, 0.3], [0.5, 0.1, 0.3], [0.5, 0.2, 0.3], [0.2, 0.2, 0.3], [0.1, 0.4, 0.3]]
                ),
                ((0, 1, 2, 3, 4),),
            ),
            white,
        ),
    )
    camera = Camera(
        eye=np.array([0.9, 0.1, 0.8]),
        target=np.array([0.4, 0.6, 0.3]),
        up=np.array([0.0, 0.0, 1.0]),
        vertical_fov=60.0,
        width=32,
        height=24,
    )
    return Scene(objects={o.id: o for o in objects}, cameras={"main": camera})


def _solve(scene: Scene) -> tuple[World, RadiositySolver]:
    world = World.of(scene)
    solver = RadiositySolver(world.surfaces, world.rays, _SETTINGS)
    while solver.step(_SLICE):
        pass
    solver.field()
    return world, solver


def _edit(drawing: Drawing) -> None:
    """A grey solution that becomes a coloured one, loses an object and has one moved."""
    engine = Engine(_room(_GREY, _LIGHT, range(6)), _SETTINGS, drawing=drawing)
    _run(engine)
    engine.apply(
        [
            SetMaterialEdit(op="set_material", id="table", material=MaterialDocument(reflectance=list(_RED))),
            _MOVE,
            RemoveEdit(op="remove", id="lamp"),
        ]
    )
    _run(engine)
    engine.probe(np.array([[0.5, 0.3, 0.0], [0.0, 0.5, 0.5]]), np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
    engine.status()


def _run(engine: Engine) -> None:
    while engine.step(_SLICE):
        pass


def _mesh() -> None:
    """Meshes without and with seams between elements of different size; also where frames can't be drawn."""
    scene = _room(_RED, _WARM_LIGHT, range(6))
    world, solver = _solve(scene)
    Tessellator(world.surfaces).mesh(solver.field())
    cells, none = Cells.of(solver.field()), ConstraintEdges.none()
    triangulate(cells, world.surfaces, none, triangulate(cells, world.surfaces, none))


def _draw(drawing: Drawing) -> None:
    if drawing.problem is not None:
        return
    for scene in (_room(_RED, _WARM_LIGHT, range(5)), _room(_GREY, _LIGHT, range(6))):
        engine = Engine(scene, _FEW_PATHS, drawing=drawing)
        _run(engine)
        for request in _drawable(drawing):
            engine.outlook(request)
            _run(engine)
            engine.frame(request)
        _pick_and_probe(engine)
    # What was seen before an edit follows the light, and is taken over.
    engine.apply([_MOVE])
    engine.frame(FrameRequest(CameraChoice(), RendererName.INTERPOLANT))
    _run(engine)
    for renderer in (RendererName.INTERPOLANT, RendererName.VPL):
        engine.outlook(FrameRequest(CameraChoice(), renderer))
        _run(engine)


def _reflect(drawing: Drawing) -> None:
    """A frame by virtual lights of a scene with a mirror, gloss broad and narrow, and a directional lamp."""
    if drawing.problem is not None:
        return
    scene = _specular(_room(_RED, _WARM_LIGHT, range(5)), 4.0)
    table = scene.object("table")
    narrow = replace(table.material, specular=np.array([0.1, 0.2, 0.3]), exponent=1000.0)
    scene = scene.with_replaced(replace(table, material=narrow))
    walls = scene.object("walls")
    mirror = replace(walls.material, specular=np.full(3, 0.3), exponent=math.inf)
    for shown in (scene, scene.with_replaced(replace(walls, material=mirror))):
        engine = Engine(shown, _FEW_PATHS, drawing=drawing)
        request = FrameRequest(CameraChoice(), RendererName.VPL)
        while engine.outlook(request).improving:
            engine.step(_SLICE)
        engine.frame(request)


def _pick_and_probe(engine: Engine) -> None:
    """What a pixel shows, and the overlays that call what frames do not."""
    camera = engine.scene.cameras["main"]
    middle = Pixel(camera.width // 2, camera.height // 2)
    engine.pick(CameraChoice(), middle.x, middle.y)
    for overlay in (ProbeOverlay(middle), BackprojectionOverlay(middle)):
        request = OverlayRequest(overlay, CameraChoice())
        while not engine.is_overlay_ready(request, complete=True):
            engine.step(_SLICE)
        for _ in engine.overlay(request):
            pass


def _follow_links() -> None:
    """Point irradiance over links, as scenes of many patches have it."""
    _, solver = _solve(_room(_RED, _WARM_LIGHT, range(5)))
    point = PointIrradiance.of(solver.state, solver.hierarchy, few=0)
    leaves = solver.state.tree.leaves
    point.at(solver.state.tree.centroid[leaves], leaves)


def _bake() -> None:
    """A lightmap, which needs no OpenGL."""
    engine = Engine(_room(_RED, _WARM_LIGHT, range(5)), replace(_SETTINGS, max_paths=16))
    bake = engine.bake(LightmapRequest(density=4.0))
    while bake is not None and bake.step(_SLICE):
        pass
    if bake is not None:
        encode_lightmap(bake.lightmap(), LightmapFormat.PNG, 1.0)


def _drawable(drawing: Drawing) -> Iterator[FrameRequest]:
    """Frames of every renderer and layer that there is."""
    for renderer in RendererName:
        for layer in LayerName:
            if renderer in (RendererName.PATH, RendererName.AUTO):
                continue
            try:
                drawing.require(renderer, layer)
            except NotAvailableError:
                continue
            for samples in (1, 4):
                yield FrameRequest(CameraChoice(), renderer, layer, samples)


def _encode() -> None:
    """A file of every format and by every curve; path-traced frames need them without OpenGL too."""
    image = np.full((8, 8, 3), 0.2, dtype=np.float32)
    for chosen in (*PictureFormat, *LinearFormat):
        encode(image, LayerName.RADIANCE, Encoding(chosen))
    for curve in ToneCurve:
        encode(image, LayerName.RADIANCE, Encoding(PictureFormat.PNG, tone_map=curve))


def _trace() -> None:
    """Paths through a diffuse scene, and through gloss and a directional lamp, which other code traces."""
    scene = _room(_RED, _WARM_LIGHT, range(5))
    _trace_scene(scene)
    _trace_scene(_specular(scene, 20.0))


def _specular(scene: Scene, exponent: float) -> Scene:
    """`scene` with a glossy screen and a directional lamp."""
    screen, lamp = scene.object("screen"), scene.object("lamp")
    gloss = replace(screen.material, specular=np.array([0.1, 0.2, 0.3]), exponent=exponent)
    spot = replace(lamp.material, emission_exponent=4.0)
    return scene.with_replaced(replace(screen, material=gloss)).with_replaced(replace(lamp, material=spot))


def _trace_scene(scene: Scene) -> None:
    """A path-traced frame, and irradiance at points and on elements."""
    world = World.of(scene)
    tracer = PathTracer(world.surfaces, world.rays)
    tracer.frame(scene.cameras["main"], passes=2).run()
    surfaces = world.surfaces
    tracer.irradiance(surfaces.corners[:2].mean(axis=1), surfaces.normal[:2], 32)
    patches = np.arange(surfaces.patch_count, dtype=np.int32)
    tracer.mean_irradiance(surfaces.corners, surfaces.corner_count, patches, 32)
