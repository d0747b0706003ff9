"""Validates a MaterialX document and draws a plane with it in MaterialX's own renderer.

    render_plane.py < QUERIES.json > ANSWERS.json

The query names the document and a material of it, and has directions to light, unit vectors in the plane's frame (x along u,
y along v, z up), and the width of the picture. The answer has the validator's complaints and, for each light, the radiance
at the pixels times pi, as a renderer with a directional light of radiance 1 shows it, with the unit vectors to the eye.
An OpenGL context is needed: without a display, `xvfb-run` gives one.
"""

import json
import math
import os
import sys

import MaterialX as mx
import MaterialX.PyMaterialXGenGlsl as gen_glsl
import MaterialX.PyMaterialXGenShader as gen_shader
import MaterialX.PyMaterialXRender as mx_render
import MaterialX.PyMaterialXRenderGlsl as render_glsl

EYE = (0.0, 0.0, 1.5)
#: A plane of 2 x 2 that its texture covers once.
PLANE = os.path.join(os.path.dirname(os.path.abspath(__file__)), os.pardir, "quad.obj")


def read(path):
    """The document with the libraries that it stands on, and the complaints of the validator."""
    search = mx.getDefaultDataSearchPath()
    libraries = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, libraries)
    document = mx.createDocument()
    document.setDataLibrary(libraries)
    mx.readFromXmlFile(document, path)
    valid, complaints = document.validate()
    return document, search, "" if valid else complaints


def draw(document, search, material, light, size):
    """Pixels of the plane, row by row from below: three numbers each."""
    node = document.addNode("directional_light", "light_of_the_test", "lightshader")
    node.setInputValue("direction", mx.Vector3(*(-x for x in light)))
    node.setInputValue("color", mx.Color3(1.0, 1.0, 1.0))
    node.setInputValue("intensity", 1.0)

    generator = gen_glsl.GlslShaderGenerator.create()
    context = gen_shader.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    colours = gen_shader.DefaultColorManagementSystem.create(generator.getTarget())
    colours.loadLibrary(document.getDataLibrary())
    generator.setColorManagementSystem(colours)
    units = gen_shader.UnitSystem.create(generator.getTarget())
    units.loadLibrary(document.getDataLibrary())
    generator.setUnitSystem(units)
    context.getOptions().targetDistanceUnit = "meter"
    context.getOptions().targetColorSpaceOverride = "lin_rec709"
    context.getOptions().hwSpecularEnvironmentMethod = (
        gen_shader.HwSpecularEnvironmentMethod.SPECULAR_ENVIRONMENT_FIS)
    context.getOptions().hwMaxActiveLightSources = 1
    context.getOptions().fileTextureVerticalFlip = True

    renderer = render_glsl.GlslRenderer.create(size, size, mx_render.BaseType.FLOAT)
    renderer.initialize(None)
    images = render_glsl.GLTextureHandler.create(mx_render.StbImageLoader.create())
    images.setSearchPath(mx.FileSearchPath(os.path.dirname(os.path.abspath(document.getSourceUri()))))
    renderer.setImageHandler(images)
    lights = mx_render.LightHandler.create()
    lights.setIndirectLighting(False)
    renderer.setLightHandler(lights)
    lights.registerLights(document, [node], context)
    lights.setLightSources([node])

    geometry = renderer.getGeometryHandler()
    geometry.addLoader(mx_render.TinyObjLoader.create())
    geometry.loadGeometry(mx.FilePath(PLANE), False)
    camera = mx_render.Camera.create()
    camera.setViewMatrix(mx_render.Camera.createViewMatrix(
        mx.Vector3(*EYE), mx.Vector3(0, 0, 0), mx.Vector3(0, 1, 0)))
    # The picture is the square of half the plane's width.
    near, far = 0.1, 10.0
    half = 0.5 * near / EYE[2]
    camera.setProjectionMatrix(mx_render.Camera.createPerspectiveMatrix(-half, half, -half, half, near, far))
    camera.setWorldMatrix(mx.Matrix44.IDENTITY)
    renderer.setCamera(camera)

    shader = generator.generate("shader", material, context)
    renderer.createProgram(shader)
    renderer.validateInputs()
    renderer.render()
    image = renderer.captureImage(None)
    pixels = []
    for y in range(size):
        for x in range(size):
            colour = image.getTexelColor(x, y)
            pixels.append([colour[0] * math.pi, colour[1] * math.pi, colour[2] * math.pi])
    return pixels


def eyes(size):
    """Unit vectors to the eye at the pixels, row by row from below."""
    out = []
    for y in range(size):
        for x in range(size):
            place = [(x + 0.5) / size - 0.5, (y + 0.5) / size - 0.5, 0.0]
            to = [EYE[i] - place[i] for i in range(3)]
            length = math.sqrt(sum(a * a for a in to))
            out.append([a / length for a in to])
    return out


def main():
    query = json.load(sys.stdin)
    answer = {"complaints": "", "pictures": [], "eyes": eyes(query["size"])}
    for light in query["lights"]:
        document, search, answer["complaints"] = read(query["document"])
        material = document.getNode(query["material"])
        if material is None or answer["complaints"]:
            break
        answer["pictures"].append(draw(document, search, material, light, query["size"]))
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
