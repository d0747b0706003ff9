//! A USD layer, as text: a plane of the asset's physical size with a material that has UsdPreviewSurface and, for renderers that
//! know MaterialX, an OpenPBR Surface.

use crate::export::openpbr::graph::Graph;
use crate::export::usd::network::write_network;
use crate::export::usd::preview::PREVIEW_TEXTURES;
use std::fmt::Write;

/// What a layer says besides its networks.
pub struct LayerNames<'a> {
    /// Name of the root prim: letters, digits and underscores.
    pub name: &'a str,
    /// Start of the textures' file names.
    pub textures: &'a str,
    /// Where the asset lies, relative to the layer or the package.
    pub asset: &'a str,
    /// The asset's checksum as 16 hexadecimal digits.
    pub checksum: &'a str,
    /// Width and height of the plane in metres.
    pub size_m: [f32; 2],
    /// Whether the asset tells that size.
    pub size_is_known: bool,
    /// Whether light comes through.
    pub double_sided: bool,
}

/// Returns the text of the layer.
pub fn usd_layer(names: &LayerNames<'_>, graph: &Graph) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_layer(&mut text, names, graph);
    text
}

fn write_layer(out: &mut String, names: &LayerNames<'_>, graph: &Graph) -> std::fmt::Result {
    let LayerNames { name, asset, checksum, .. } = names;
    let material = format!("/{name}/material");
    let [x, y] = names.size_m.map(|side| 0.5 * side);
    let version = env!("CARGO_PKG_VERSION");
    writeln!(
        out,
        "#usda 1.0\n(\n    defaultPrim = \"{name}\"\n    doc = \"btf-fit {version}\"\n    metersPerUnit = 1\n    upAxis = \
         \"Y\"\n)\n\ndef Xform \"{name}\" (\n    kind = \"component\"\n)\n{{"
    )?;
    writeln!(
        out,
        "    def Mesh \"plane\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{
        uniform bool doubleSided = {}
        float3[] extent = [({}, {}, 0), ({x}, {y}, 0)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        rel material:binding = <{material}>
        normal3f[] normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (
            interpolation = \"vertex\"
        )
        point3f[] points = [({}, {}, 0), ({x}, {}, 0), ({x}, {y}, 0), ({}, {y}, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
            interpolation = \"vertex\"
        )
        uniform token subdivisionScheme = \"none\"
    }}\n",
        u8::from(names.double_sided),
        -x,
        -y,
        -x,
        -y,
        -y,
        -x
    )?;
    let size = match names.size_is_known {
        true => format!("                float2 size_m = ({}, {})\n", names.size_m[0], names.size_m[1]),
        false => String::new(),
    };
    writeln!(
        out,
        "    def Material \"material\" (\n        customData = {{\n            dictionary btf = {{\n                string \
         asset = \"{}\"\n                string checksum = \"{checksum}\"\n{size}            }}\n        }}\n    )\n    {{",
        quoted(asset)
    )?;
    writeln!(out, "        token outputs:mtlx:surface.connect = <{material}/openpbr.outputs:out>")?;
    writeln!(out, "        token outputs:surface.connect = <{material}/preview.outputs:surface>\n")?;
    write_preview(out, names, &material)?;
    write_network(out, graph, &material)?;
    writeln!(out, "    }}\n}}")
}

/// Writes UsdPreviewSurface and its textures.
fn write_preview(out: &mut String, names: &LayerNames<'_>, material: &str) -> std::fmt::Result {
    let [diffuse, specular, normal, roughness] = PREVIEW_TEXTURES;
    let connect = |kind: &str, input: &str, texture: &str, output: &str| {
        format!("            {kind} inputs:{input}.connect = <{material}/{texture}.outputs:{output}>\n")
    };
    writeln!(
        out,
        "        def Shader \"preview\"\n        {{\n            uniform token info:id = \"UsdPreviewSurface\"\n            int \
         inputs:useSpecularWorkflow = 1\n{}{}{}{}            token outputs:surface\n        }}",
        connect("color3f", "diffuseColor", diffuse, "rgb"),
        connect("color3f", "specularColor", specular, "rgb"),
        connect("normal3f", "normal", normal, "rgb"),
        connect("float", "roughness", roughness, "r"),
    )?;
    writeln!(
        out,
        "        def Shader \"st\"\n        {{\n            uniform token info:id = \"UsdPrimvarReader_float2\"\n            \
         string inputs:varname = \"st\"\n            float2 outputs:result\n        }}"
    )?;
    for texture in PREVIEW_TEXTURES {
        let (space, signed) = match texture {
            _ if texture == normal => ("raw", true),
            _ if texture == roughness => ("raw", false),
            _ => ("sRGB", false),
        };
        let range = match signed {
            true => {
                "            float4 inputs:bias = (-1, -1, -1, -1)\n            float4 inputs:scale = (2, 2, 2, 2)\n"
            }
            false => "",
        };
        let output = if texture == roughness { "float outputs:r" } else { "float3 outputs:rgb" };
        writeln!(
            out,
            "        def Shader \"{texture}\"\n        {{\n            uniform token info:id = \"UsdUVTexture\"\n            \
             asset inputs:file = @{}{texture}.png@\n            token inputs:sourceColorSpace = \"{space}\"\n            token \
             inputs:wrapS = \"repeat\"\n            token inputs:wrapT = \"repeat\"\n            float2 inputs:st.connect = \
             <{material}/st.outputs:result>\n{range}            {output}\n        }}",
            names.textures
        )?;
    }
    Ok(())
}

/// Escapes what a string of a layer cannot hold as it is.
fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}
