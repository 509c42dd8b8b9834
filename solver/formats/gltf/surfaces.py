"""Materials of glTF as materials of this project, face by face where textures differ.

Base colour is diffuse reflectance, or of what is metallic specular reflectance with the lobe of its
roughness, unless that is so broad that it is diffuse. The dielectric coat, which reflects some 4 %, is left
out. Emission is in cd/m2, as the specification has it where light has units.

What this project writes has its own numbers in a material's `extras`, under the names of a scene document;
they go before all else, so that they come back to the last digit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from solver.document.fields import Location
from solver.document.models import MaterialDocument
from solver.errors import SceneError
from solver.formats.building import SceneBuilder
from solver.formats.gltf.container import Container
from solver.formats.gltf.models import Material, MetallicRoughness, Primitive, TextureInfo
from solver.formats.shading import Shade, exitance_of_luminance, is_nearly_diffuse, phong_exponent
from solver.formats.textures import Texture, UnreadableTextureError
from solver.types import FloatArray, Int64Array

_CLAMP: Final = 33071
_OWN_FIELDS: Final = frozenset(MaterialDocument.model_fields)
_TELLING: Final = {"reflectance", "emission"}
"""Members of `extras` by which this project's own are known."""

_BASE, _GLOW, _METAL, _ROUGH = slice(0, 3), slice(3, 6), 6, 7
"""Columns of a face's values: base colour, emissive colour over its factor, metallic, roughness."""


@dataclass(frozen=True, eq=False)
class Painted:
    """What the faces of a primitive look like."""

    material: Material
    own: MaterialDocument | None
    """As this project has written it"""
    values: FloatArray
    """(f, 8), or (1, 8) where all faces are alike"""

    def shade(self, values: FloatArray, efficacy: float) -> Shade | MaterialDocument:
        """The surface of a group of faces with the mean `values` (8,); lm/W."""
        if self.own is not None:
            return self.own
        strength = self.material.extensions.KHR_materials_emissive_strength.emissiveStrength
        glow = strength * np.array(self.material.emissiveFactor) * values[_GLOW]
        emission = exitance_of_luminance(glow, efficacy)
        base, metallic = values[_BASE], float(values[_METAL])
        exponent = phong_exponent(float(values[_ROUGH]) ** 2)
        two_sided = self.material.doubleSided
        if metallic <= 0.0 or is_nearly_diffuse(exponent):
            return Shade.matt(base, emission, two_sided)
        return Shade((1.0 - metallic) * base, emission, metallic * base, exponent, two_sided)


class Painter:
    """Finds what faces look like."""

    def __init__(self, container: Container, builder: SceneBuilder) -> None:
        self._container = container
        self._builder = builder
        self._textures: dict[int, Texture] = {}

    def paint(self, primitive: Primitive, triangles: Int64Array, count: int, where: Location) -> Painted:
        """The looks of `triangles` (t, 3) over `count` vertices. Raises SceneError, LimitExceededError."""
        container, file = self._container, self._container.file
        if primitive.material is None:
            # The default of the specification is a white metal: rough, so diffuse.
            material = Material()
        else:
            index = primitive.material
            material = container.item(file.materials, index, (*where, "material"), "material")
            where = ("materials", index)
        own = _own(material.extras)
        plain = _factors(material)
        if own is not None:
            return Painted(material, own, plain[None])
        if material.alphaMode != "OPAQUE" or material.extensions.KHR_materials_transmission:
            self._builder.warn("transparency is left out: its surfaces are opaque")
        values = plain[None]
        glossy = material.extensions.KHR_materials_pbrSpecularGlossiness
        model = material.pbrMetallicRoughness or MetallicRoughness()
        base = glossy.diffuseTexture if glossy is not None else model.baseColorTexture
        for info, columns, picked, is_colour in (
            (base, [0, 1, 2], [0, 1, 2], True),
            (material.emissiveTexture, [3, 4, 5], [0, 1, 2], True),
            (None if glossy is not None else model.metallicRoughnessTexture, [6, 7], [2, 1], False),
        ):
            if info is None:
                continue
            means = self._means(info, primitive, triangles, count, is_colour, where)
            values = np.repeat(values, len(means), axis=0) if len(values) == 1 else values
            values[:, columns] *= means[:, picked]
            self._builder.warn("textures are averaged over faces")
        if "COLOR_0" in primitive.attributes:
            values = self._times_vertex_colours(values, primitive, triangles, count, where)
        return Painted(material, None, values)

    def _means(
        self,
        info: TextureInfo,
        primitive: Primitive,
        triangles: Int64Array,
        count: int,
        is_colour: bool,
        where: Location,
    ) -> FloatArray:
        """(t, 3) means of a texture over triangles."""
        texture = self._texture(info.index, where)
        moved = info.extensions.KHR_texture_transform
        channel = info.texCoord if moved is None or moved.texCoord is None else moved.texCoord
        name = f"TEXCOORD_{channel}"
        if name not in primitive.attributes:
            # Without coordinates nothing says where a face is in the picture: it gets the mean of all of it.
            return texture.polygon_means([None], is_colour)
        uv = self._container.floats(primitive.attributes[name], 2, where)
        if len(uv) < count:
            raise SceneError(f"{name} has {len(uv)} values for {count} vertices", where)
        if moved is not None:
            c, s = np.cos(moved.rotation), np.sin(moved.rotation)
            uv = (uv * moved.scale) @ np.array([[c, -s], [s, c]]) + moved.offset
        if not np.isfinite(uv).all() or np.abs(uv).max(initial=0.0) > 1e9:
            raise SceneError(f"{name} holds what are no coordinates", where)
        return texture.triangle_means(uv[triangles], is_colour)

    def _texture(self, index: int, where: Location) -> Texture:
        if index in self._textures:
            return self._textures[index]
        container, file = self._container, self._container.file
        texture = container.item(file.textures, index, where, "texture")
        webp = texture.extensions.EXT_texture_webp
        source = texture.source if webp is None else webp.source
        place: Location = ("textures", index)
        if source is None:
            raise SceneError("it has no source that is read", place)
        image = container.item(file.images, source, (*place, "source"), "image")
        at: Location = ("images", source)
        if image.bufferView is not None:
            content = container.view(image.bufferView, (*at, "bufferView"))
        elif image.uri is not None:
            content = container.resource(image.uri, (*at, "uri"))
        else:
            raise SceneError("neither a URI nor a buffer view", at)
        clamps = False
        if texture.sampler is not None:
            sampler = container.item(file.samplers, texture.sampler, (*place, "sampler"), "sampler")
            clamps = sampler.wrapS == _CLAMP and sampler.wrapT == _CLAMP
        try:
            found = self._textures[index] = Texture.decode(content, clamps)
        except UnreadableTextureError as refused:
            raise SceneError(str(refused), at) from None
        return found

    def _times_vertex_colours(
        self, values: FloatArray, primitive: Primitive, triangles: Int64Array, count: int, where: Location
    ) -> FloatArray:
        index = primitive.attributes["COLOR_0"]
        accessor = self._container.item(self._container.file.accessors, index, where, "accessor")
        colours = self._container.floats(index, 4 if accessor.type == "VEC4" else 3, where)
        if len(colours) < count:
            raise SceneError(f"COLOR_0 has {len(colours)} values for {count} vertices", where)
        if not np.isfinite(colours).all():
            raise SceneError("COLOR_0 holds what are no colours", where)
        means = colours[triangles, :3].mean(axis=1).clip(0.0, 1.0)
        values = np.repeat(values, len(means), axis=0) if len(values) == 1 else values
        values[:, _BASE] *= means
        self._builder.warn("colours of vertices are averaged over faces")
        return values


def _factors(material: Material) -> FloatArray:
    """(8,) the values of a material without its textures."""
    glossy = material.extensions.KHR_materials_pbrSpecularGlossiness
    if glossy is not None:
        return np.array([*glossy.diffuseFactor[:3], 1.0, 1.0, 1.0, 0.0, 1.0])
    model = material.pbrMetallicRoughness or MetallicRoughness()
    return np.array([*model.baseColorFactor[:3], 1.0, 1.0, 1.0, model.metallicFactor, model.roughnessFactor])


def _own(extras: Any) -> MaterialDocument | None:
    """The material that this project has written, if it has."""
    if not isinstance(extras, dict) or not extras.keys() >= _TELLING:
        return None
    try:
        found = MaterialDocument.model_validate({k: v for k, v in extras.items() if k in _OWN_FIELDS})
    except ValidationError:
        return None
    total = np.array(found.reflectance) + np.array(found.specular)
    return found if total.max() < 1.0 else None
