//! A MaterialX document with an OpenPBR Surface whose inputs are textures, and the same as a Standard Surface
//! (docs/reference/materialx.md).

use crate::error::FitError;
use crate::export::openpbr::graph::{Graph, Node, Source, graph_of, openpbr_inputs, standard_inputs};
use crate::export::openpbr::textures::OpenPbrTextures;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};

/// What a document says besides its textures.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialXNames {
    /// Name of the material: letters, digits and underscores.
    pub material: String,
    /// Start of the textures' file names, with the folder that they lie in.
    pub textures: String,
    /// Where the asset lies, relative to the document.
    pub asset: String,
    /// The asset's checksum as 16 hexadecimal digits.
    pub checksum: String,
    /// Physical width and height of one repetition in metres.
    pub size_m: Option<[f32; 2]>,
}

/// Writes the document: a graph of the textures, an OpenPBR Surface, a Standard Surface and a material of each. The
/// materials have the attributes `btf_asset`, `btf_checksum` and `btf_size_m`.
///
/// # Errors
/// [`FitError::Params`] if the text cannot be made.
pub fn materialx_document(textures: &OpenPbrTextures, names: &MaterialXNames) -> Result<String, FitError> {
    let graph = graph_of(textures, &names.textures);
    write(&graph, names)
        .map_err(|error| FitError::Params(format!("the MaterialX document could not be written ({error})")))
}

fn write(graph: &Graph, names: &MaterialXNames) -> std::io::Result<String> {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    writer.write_event(Event::Decl(BytesDecl::new("1.0", None, None)))?;
    let name = &names.material;
    let graph_name = format!("NG_{name}");
    writer
        .create_element("materialx")
        .with_attributes([("version", "1.39"), ("colorspace", "lin_rec709")])
        .write_inner_content(|writer| {
            for attribute in ["btf_asset", "btf_checksum", "btf_size_m"] {
                writer
                    .create_element("attributedef")
                    .with_attribute(("name", format!("AD_{attribute}").as_str()))
                    .with_attributes([("attrname", attribute), ("type", "string"), ("elements", "surfacematerial")])
                    .write_empty()?;
            }
            writer.create_element("nodegraph").with_attribute(("name", graph_name.as_str())).write_inner_content(
                |writer| {
                    for node in &graph.nodes {
                        write_node(writer, node, &graph_name)?;
                    }
                    for (output, (kind, node)) in &graph.outputs {
                        writer
                            .create_element("output")
                            .with_attribute(("name", name_of(output).as_str()))
                            .with_attributes([("type", *kind), ("nodename", node.as_str())])
                            .write_empty()?;
                    }
                    Ok(())
                },
            )?;
            for (category, suffix, inputs) in [
                ("open_pbr_surface", "", openpbr_inputs(graph)),
                ("standard_surface", "_standard", standard_inputs(graph)),
            ] {
                let shader = format!("SR_{name}{suffix}");
                let surface = Node { category, name: shader.clone(), kind: "surfaceshader", inputs };
                write_node(writer, &surface, &graph_name)?;
                let size = names.size_m.map_or(String::new(), |[width, height]| format!("{width}, {height}"));
                let mut material = writer.create_element("surfacematerial").with_attributes([
                    ("name", format!("M_{name}{suffix}").as_str()),
                    ("type", "material"),
                    ("btf_asset", names.asset.as_str()),
                    ("btf_checksum", names.checksum.as_str()),
                ]);
                if !size.is_empty() {
                    material = material.with_attribute(("btf_size_m", size.as_str()));
                }
                material.write_inner_content(|writer| {
                    writer
                        .create_element("input")
                        .with_attributes([("name", "surfaceshader"), ("type", "surfaceshader")])
                        .with_attribute(("nodename", shader.as_str()))
                        .write_empty()?;
                    Ok(())
                })?;
            }
            Ok(())
        })?;
    let mut bytes = writer.into_inner();
    bytes.push(b'\n');
    String::from_utf8(bytes).map_err(std::io::Error::other)
}

/// Returns the name of an output: nodes and outputs of a graph must not share one.
fn name_of(output: &str) -> String {
    format!("{output}_out")
}

fn write_node(writer: &mut Writer<Vec<u8>>, node: &Node, graph: &str) -> std::io::Result<()> {
    writer
        .create_element(node.category)
        .with_attributes([("name", node.name.as_str()), ("type", node.kind)])
        .write_inner_content(|writer| {
            for (input, from) in &node.inputs {
                let element = writer.create_element("input").with_attribute(("name", *input));
                match from {
                    Source::Text(kind, text) => {
                        let srgb = *kind == "filename" && node.kind == "color3";
                        let element = element.with_attributes([("type", *kind), ("value", text.as_str())]);
                        match srgb {
                            true => element.with_attribute(("colorspace", "srgb_texture")).write_empty()?,
                            false => element.write_empty()?,
                        }
                    }
                    Source::Node(kind, name) => {
                        element.with_attributes([("type", *kind), ("nodename", name.as_str())]).write_empty()?
                    }
                    Source::Output(kind, output) => element
                        .with_attributes([("type", *kind), ("nodegraph", graph), ("output", name_of(output).as_str())])
                        .write_empty()?,
                };
            }
            Ok(())
        })?;
    Ok(())
}
