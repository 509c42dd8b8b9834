"""The parts of a glTF 2.0 file that are read, as the specification types them.

Unknown members are ignored: extensions that must not be are named in `extensionsRequired`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

Index: TypeAlias = Annotated[int, Field(ge=0, lt=2**31)]
Number: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=-1e30, le=1e30)]
Positive: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e30)]
Share: TypeAlias = Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1.0)]
Triple: TypeAlias = Annotated[list[Number], Field(min_length=3, max_length=3)]
Colour: TypeAlias = Annotated[list[Positive], Field(min_length=3, max_length=3)]


class Open(BaseModel):
    """A model that passes over members that it does not know."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Asset(Open):
    """What the file says of itself."""

    version: str


class Buffer(Open):
    """Bytes, here or elsewhere."""

    byteLength: Index
    uri: str | None = None


class BufferView(Open):
    """A part of a buffer."""

    buffer: Index
    byteOffset: Index = 0
    byteLength: Index
    byteStride: Annotated[int, Field(ge=1, le=252)] | None = None


class SparseIndices(Open):
    """Which values a sparse accessor replaces."""

    bufferView: Index
    byteOffset: Index = 0
    componentType: Literal[5121, 5123, 5125]


class SparseValues(Open):
    """What by."""

    bufferView: Index
    byteOffset: Index = 0


class Sparse(Open):
    """Values that differ from the rest."""

    count: Index
    indices: SparseIndices
    values: SparseValues


class Accessor(Open):
    """An array."""

    bufferView: Index | None = None
    byteOffset: Index = 0
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Index
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None


class Primitive(Open):
    """Triangles, or what else `mode` says, of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    extensions: dict[str, Any] = {}
    targets: list[Any] = []


class Mesh(Open):
    """Primitives that belong together."""

    primitives: list[Primitive]
    name: str = ""


class Perspective(Open):
    """A pinhole."""

    yfov: Annotated[float, Field(gt=0.0, lt=3.14159)]
    aspectRatio: Annotated[float, Field(gt=0.0, le=1e4)] | None = None


class Camera(Open):
    """A camera."""

    type: Literal["perspective", "orthographic"]
    perspective: Perspective | None = None
    name: str = ""
    extras: Any = None


class NodeLight(Open):
    """Which light a node carries."""

    light: Index


class NodeExtensions(Open):
    """Extensions of nodes."""

    KHR_lights_punctual: NodeLight | None = None


class Node(Open):
    """A place, and what is there."""

    name: str = ""
    children: list[Index] = []
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] | None = None
    translation: Triple = [0.0, 0.0, 0.0]
    rotation: Annotated[list[Number], Field(min_length=4, max_length=4)] = [0.0, 0.0, 0.0, 1.0]
    scale: Triple = [1.0, 1.0, 1.0]
    mesh: Index | None = None
    camera: Index | None = None
    skin: Index | None = None
    extensions: NodeExtensions = NodeExtensions()


class TextureTransform(Open):
    """KHR_texture_transform."""

    offset: Annotated[list[Number], Field(min_length=2, max_length=2)] = [0.0, 0.0]
    rotation: Number = 0.0
    scale: Annotated[list[Number], Field(min_length=2, max_length=2)] = [1.0, 1.0]
    texCoord: Index | None = None


class TextureInfoExtensions(Open):
    """Extensions of references to textures."""

    KHR_texture_transform: TextureTransform | None = None


class TextureInfo(Open):
    """A texture, and the coordinates by which it lies on a mesh."""

    index: Index
    texCoord: Index = 0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class MetallicRoughness(Open):
    """The usual model of surfaces."""

    baseColorFactor: Annotated[list[Positive], Field(min_length=4, max_length=4)] = [1.0, 1.0, 1.0, 1.0]
    baseColorTexture: TextureInfo | None = None
    metallicFactor: Share = 1.0
    roughnessFactor: Share = 1.0
    metallicRoughnessTexture: TextureInfo | None = None


class SpecularGlossiness(Open):
    """KHR_materials_pbrSpecularGlossiness, of which the diffuse part is read."""

    diffuseFactor: Annotated[list[Positive], Field(min_length=4, max_length=4)] = [1.0, 1.0, 1.0, 1.0]
    diffuseTexture: TextureInfo | None = None


class EmissiveStrength(Open):
    """KHR_materials_emissive_strength."""

    emissiveStrength: Positive = 1.0


class MaterialExtensions(Open):
    """Extensions of materials."""

    KHR_materials_emissive_strength: EmissiveStrength = EmissiveStrength()
    KHR_materials_pbrSpecularGlossiness: SpecularGlossiness | None = None
    KHR_materials_transmission: dict[str, Any] | None = None


class Material(Open):
    """A surface."""

    name: str = ""
    pbrMetallicRoughness: MetallicRoughness | None = None
    emissiveFactor: Colour = [0.0, 0.0, 0.0]
    emissiveTexture: TextureInfo | None = None
    alphaMode: str = "OPAQUE"
    doubleSided: bool = False
    extensions: MaterialExtensions = MaterialExtensions()
    extras: Any = None


class Image(Open):
    """A picture, here or elsewhere."""

    uri: str | None = None
    bufferView: Index | None = None


class TextureSource(Open):
    """EXT_texture_webp."""

    source: Index


class TextureExtensions(Open):
    """Extensions of textures."""

    EXT_texture_webp: TextureSource | None = None


class Texture(Open):
    """A picture and how it goes on outside of itself."""

    source: Index | None = None
    sampler: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Sampler(Open):
    """How a picture goes on outside of itself."""

    wrapS: int = 10497
    wrapT: int = 10497


class Spot(Open):
    """The cone of a spot light."""

    innerConeAngle: Annotated[float, Field(ge=0.0, le=1.5708)] = 0.0
    outerConeAngle: Annotated[float, Field(gt=0.0, le=1.5708)] = 0.7853981633974483


class Light(Open):
    """A light of KHR_lights_punctual."""

    type: Literal["directional", "point", "spot"]
    color: Colour = [1.0, 1.0, 1.0]
    intensity: Positive = 1.0
    spot: Spot = Spot()
    name: str = ""
    range: float | None = None


class Lights(Open):
    """KHR_lights_punctual."""

    lights: list[Light] = []


class FileExtensions(Open):
    """Extensions of the file."""

    KHR_lights_punctual: Lights = Lights()


class Scene(Open):
    """What is shown together."""

    name: str = ""
    nodes: list[Index] = []
    extras: Any = None


class GltfFile(Open):
    """The file."""

    asset: Asset
    buffers: list[Buffer] = []
    bufferViews: list[BufferView] = []
    accessors: list[Accessor] = []
    meshes: list[Mesh] = []
    cameras: list[Camera] = []
    nodes: list[Node] = []
    materials: list[Material] = []
    images: list[Image] = []
    textures: list[Texture] = []
    samplers: list[Sampler] = []
    scenes: list[Scene] = []
    scene: Index | None = None
    skins: list[Any] = []
    animations: list[Any] = []
    extensionsRequired: list[str] = []
    extensions: FileExtensions = FileExtensions()
