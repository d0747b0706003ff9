"""Opens a USD layer or package, runs the validators of OpenUSD over it and describes what it shows.

    validate.py FILE.usda|FILE.usdz > REPORT.json

The report has complaints, a sentence each: those of all validators of usd-core, connections of shaders that lead nowhere,
files that are not there, and nodes that MaterialX's libraries do not define. Beside them stand size, bounds and the custom data
of the material.
"""

import json
import sys

import MaterialX as mx
from pxr import Ar, Usd, UsdGeom, UsdShade, UsdValidation

# The wheel has no plugin that tells USD of MaterialX's nodes; they are checked here.
MATERIALX = "ND_"


def validators():
    """All validators but suites, which are lists of others."""
    return UsdValidation.ValidationRegistry().GetOrLoadAllValidators()


def shader_complaints(stage, prim, definitions):
    """What is wrong with a shader's identifier, connections and files."""
    shader = UsdShade.Shader(prim)
    identifier = shader.GetShaderId()
    definition = definitions.getNodeDef(identifier) if identifier.startswith(MATERIALX) else None
    if identifier.startswith(MATERIALX) and definition is None:
        yield f"{prim.GetPath()}: MaterialX defines no {identifier}"
    for entry in shader.GetInputs():
        name = entry.GetBaseName()
        if definition is not None and definition.getActiveInput(name) is None:
            yield f"{prim.GetPath()}: {identifier} has no input {name}"
        for path in entry.GetAttr().GetConnections():
            if not stage.GetAttributeAtPath(path):
                yield f"{prim.GetPath()}: {name} is connected to {path}, which is not there"
        value = entry.Get()
        if hasattr(value, "resolvedPath"):
            if not value.resolvedPath or Ar.GetResolver().OpenAsset(Ar.ResolvedPath(value.resolvedPath)) is None:
                yield f"{prim.GetPath()}: {value.path} is not there"


def main():
    stage = Usd.Stage.Open(sys.argv[1])
    complaints = []
    for error in UsdValidation.ValidationContext(validators()).Validate(stage):
        text = error.GetErrorAsString()
        # Of nodes that the wheel does not know.
        if "ShaderSdrCompliance" in text and MATERIALX in text:
            continue
        complaints.append(text)
    libraries = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), libraries)
    shaders = [prim for prim in stage.Traverse() if prim.IsA(UsdShade.Shader)]
    for prim in shaders:
        complaints += shader_complaints(stage, prim, libraries)
    report = {"complaints": complaints, "shaders": len(shaders)}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            report["extent"] = [list(corner) for corner in mesh.GetExtentAttr().Get()]
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            report["material"] = str(material.GetPath())
            report["btf"] = {key: str(value) for key, value in material.GetPrim().GetCustomDataByKey("btf").items()}
            surface, _, _ = material.ComputeSurfaceSource()
            report["preview"] = surface.GetShaderId()
            surface, _, _ = material.ComputeSurfaceSource("mtlx")
            report["materialx"] = surface.GetShaderId()
    json.dump(report, sys.stdout)


if __name__ == "__main__":
    main()
