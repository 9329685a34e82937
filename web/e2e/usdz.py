"""Say what OpenUSD finds in a USDZ file: python usdz.py FILE prints JSON.

"complaints" are those of all of its validators, that of USDZ packages among them; "facing" is the
mean of the corners' normals in the world, each weighted with how brightly its texture glows.
"""

import io
import json
import sys
import zipfile

import numpy as np
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade, UsdValidation


def main() -> None:
    name = sys.argv[1]
    stage = Usd.Stage.Open(name)
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    bounds = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    size = bounds.ComputeWorldBound(stage.GetDefaultPrim()).ComputeAlignedRange().GetSize()
    inputs = [surface_of(mesh) for mesh in meshes]
    facts = {
        "complaints": complaints(stage),
        "up": UsdGeom.GetStageUpAxis(stage),
        "triangles": sum(len(mesh.GetFaceVertexCountsAttr().Get()) for mesh in meshes),
        "size": list(size),
        "metallic": [one.GetInput("metallic").Get() for one in inputs],
        "emits": [emits(one) for one in inputs],
    }
    if all(facts["emits"]):
        facts["facing"] = facing(name, meshes[0]).tolist()
    sys.stdout.write(json.dumps(facts))


def complaints(stage: Usd.Stage) -> list[str]:
    registry = UsdValidation.ValidationRegistry()
    known = [one.name for one in registry.GetAllValidatorMetadata()]
    context = UsdValidation.ValidationContext(registry.GetOrLoadValidatorsByName(known))
    return [f"{one.GetName()}: {one.GetMessage()}" for one in context.Validate(stage)]


def surface_of(mesh: UsdGeom.Mesh) -> UsdShade.Shader:
    material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim().GetParent()).ComputeBoundMaterial()
    return material.ComputeSurfaceSource()[0]


def emits(surface: UsdShade.Shader) -> bool:
    emission = surface.GetInput("emissiveColor")
    return bool(emission) and emission.HasConnectedSource()


def facing(name: str, mesh: UsdGeom.Mesh) -> np.ndarray:
    with zipfile.ZipFile(name) as file:
        [picture] = [one for one in file.namelist() if one.endswith(".png")]
        pixels = np.asarray(Image.open(io.BytesIO(file.read(picture))).convert("RGB"), float)
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    height, width = pixels.shape[:2]
    columns = np.floor(st[:, 0] * width).astype(int)
    rows = np.floor((1 - st[:, 1]) * height).astype(int)  # st counts from below
    glow = pixels[rows, columns].mean(axis=-1) ** 2.2
    world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim()))[:3, :3]
    normals = np.array(mesh.GetNormalsAttr().Get()) @ world
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return (normals * glow[:, None]).sum(axis=0) / glow.sum()


main()
