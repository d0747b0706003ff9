//! MaterialX nodes as shaders of a USD layer.

use crate::export::openpbr::graph::{Graph, Node, Source, openpbr_inputs};
use std::fmt::Write;

/// Name of the shader that reads texture coordinates.
const COORDINATES: &str = "texcoord";

/// Returns the identifier of a node's definition in MaterialX's standard libraries.
fn definition_of(node: &Node) -> String {
    let kind_of = |input: &str| {
        node.inputs.iter().find(|(name, _)| *name == input).map_or(node.kind, |(_, from)| match from {
            Source::Text(kind, _) | Source::Node(kind, _) | Source::Output(kind, _) => *kind,
        })
    };
    match (node.category, node.kind) {
        ("extract", _) => format!("ND_extract_{}", kind_of("in")),
        ("magnitude", _) => format!("ND_magnitude_{}", kind_of("in")),
        ("normalmap", _) => "ND_normalmap_float".into(),
        ("multiply", "vector3") if kind_of("in2") == "float" => "ND_multiply_vector3FA".into(),
        (category, kind) => format!("ND_{category}_{kind}"),
    }
}

/// Returns USD's name of a type of MaterialX.
fn usd_type(kind: &str) -> &'static str {
    match kind {
        "color3" => "color3f",
        "vector3" => "float3",
        "vector2" => "float2",
        "integer" => "int",
        "boolean" => "bool",
        "string" => "string",
        "filename" => "asset",
        "surfaceshader" => "token",
        _ => "float",
    }
}

/// Writes the graph's nodes and the surface as shaders below the material at `path`.
pub fn write_network(out: &mut String, graph: &Graph, path: &str) -> std::fmt::Result {
    writeln!(
        out,
        "        def Shader \"{COORDINATES}\"\n        {{\n            uniform token info:id = \
         \"ND_geompropvalue_vector2\"\n            string inputs:geomprop = \"st\"\n            float2 outputs:out\n        }}"
    )?;
    for node in &graph.nodes {
        write_shader(out, node, graph, path)?;
    }
    let surface = Node {
        category: "open_pbr_surface",
        name: "openpbr".into(),
        kind: "surfaceshader",
        inputs: openpbr_inputs(graph),
    };
    write_shader(out, &surface, graph, path)
}

fn write_shader(out: &mut String, node: &Node, graph: &Graph, path: &str) -> std::fmt::Result {
    writeln!(out, "        def Shader \"{}\"\n        {{", node.name)?;
    writeln!(out, "            uniform token info:id = \"{}\"", definition_of(node))?;
    for (input, from) in &node.inputs {
        match from {
            Source::Text(kind, text) => write_value(out, node, input, kind, text)?,
            Source::Node(kind, name) => {
                writeln!(out, "            {} inputs:{input}.connect = <{path}/{name}.outputs:out>", usd_type(kind))?;
            }
            Source::Output(kind, output) => {
                if let Some((_, name)) = graph.outputs.get(output) {
                    writeln!(
                        out,
                        "            {} inputs:{input}.connect = <{path}/{name}.outputs:out>",
                        usd_type(kind)
                    )?;
                }
            }
        }
    }
    if node.category == "image" {
        writeln!(out, "            float2 inputs:texcoord.connect = <{path}/{COORDINATES}.outputs:out>")?;
    }
    writeln!(out, "            {} outputs:out\n        }}", usd_type(node.kind))
}

fn write_value(out: &mut String, node: &Node, input: &str, kind: &str, text: &str) -> std::fmt::Result {
    let name = usd_type(kind);
    match kind {
        "filename" => {
            let space = if node.kind == "color3" { "srgb_texture" } else { "raw" };
            writeln!(
                out,
                "            asset inputs:{input} = @{text}@ (\n                colorSpace = \"{space}\"\n            )"
            )
        }
        "string" => writeln!(out, "            string inputs:{input} = \"{text}\""),
        "boolean" => writeln!(out, "            bool inputs:{input} = {}", u8::from(text == "true")),
        _ => writeln!(out, "            {name} inputs:{input} = {text}"),
    }
}
