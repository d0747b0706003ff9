//! A MaterialX document with an OpenPBR Surface whose inputs are textures, and the same as a Standard Surface
//! (docs/reference/materialx.md).

use crate::error::FitError;
use crate::export::openpbr::model::{COAT_IOR, SPECULAR_IOR};
use crate::export::openpbr::textures::OpenPbrTextures;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use std::collections::BTreeMap;

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

/// A node's input: its type and where its value comes from.
enum From {
    Text(&'static str, String),
    Node(&'static str, String),
    /// An output of the graph of textures.
    Output(&'static str, &'static str),
}

/// A node: category, name, type and inputs.
struct Node {
    category: &'static str,
    name: String,
    kind: &'static str,
    inputs: Vec<(&'static str, From)>,
}

/// Nodes that read and unpack the textures, and the graph's outputs with their types.
#[derive(Default)]
struct Graph {
    nodes: Vec<Node>,
    outputs: BTreeMap<&'static str, (&'static str, String)>,
}

impl Graph {
    /// Adds a node; returns its name.
    fn add(
        &mut self,
        category: &'static str,
        name: &str,
        kind: &'static str,
        inputs: Vec<(&'static str, From)>,
    ) -> String {
        self.nodes.push(Node { category, name: name.into(), kind, inputs });
        name.into()
    }

    fn output(&mut self, name: &'static str, kind: &'static str, node: String) {
        self.outputs.insert(name, (kind, node));
    }

    /// Adds a texture; returns the node that reads it.
    fn texture(&mut self, names: &MaterialXNames, name: &'static str, srgb: bool) -> String {
        let kind = if srgb { "color3" } else { "vector3" };
        let file = From::Text("filename", format!("{}{name}.png", names.textures));
        let mode = |name| (name, From::Text("string", "periodic".into()));
        self.add("image", name, kind, vec![("file", file), mode("uaddressmode"), mode("vaddressmode")])
    }

    /// Takes a channel of a texture of numbers.
    fn channel(&mut self, name: &str, of: &str, index: usize) -> String {
        let inputs =
            vec![("in", From::Node("vector3", of.into())), ("index", From::Text("integer", index.to_string()))];
        self.add("extract", name, "float", inputs)
    }

    /// Adds a node of two numbers.
    fn of_two(&mut self, category: &'static str, name: &str, a: From, b: From) -> String {
        self.add(category, name, "float", vec![("in1", a), ("in2", b)])
    }

    /// Unpacks a normal.
    fn normal(&mut self, names: &MaterialXNames, texture: &'static str, output: &'static str) {
        let read = self.texture(names, texture, false);
        let map = self.add("normalmap", &format!("{texture}_map"), "vector3", vec![("in", node("vector3", &read))]);
        self.output(output, "vector3", map);
    }

    /// Unpacks an anisotropy: its strength, and the tangent turned by half the vector's angle.
    fn anisotropy(&mut self, of: &str, strength: &'static str, tangent: &'static str) {
        let mut part = |name: &str, index| {
            let channel = self.channel(&format!("{of}_{name}_packed"), of, index);
            let twice = self.of_two("multiply", &format!("{of}_{name}_twice"), node("float", &channel), number(2.0));
            self.of_two("subtract", &format!("{of}_{name}"), node("float", &twice), number(1.0))
        };
        let (x, y) = (part("x", 0), part("y", 1));
        let both = vec![("in1", node("float", &x)), ("in2", node("float", &y))];
        let vector = self.add("combine2", &format!("{of}_vector"), "vector2", both);
        let length = self.add("magnitude", &format!("{of}_length"), "float", vec![("in", node("vector2", &vector))]);
        let clamped = vec![("in", node("float", &length))];
        let length = self.add("clamp", &format!("{of}_strength"), "float", clamped);
        let angle = vec![("iny", node("float", &y)), ("inx", node("float", &x))];
        let angle = self.add("atan2", &format!("{of}_angle"), "float", angle);
        let half = self.of_two("multiply", &format!("{of}_half_angle"), node("float", &angle), number(0.5));
        // Not rotate3d, which turns clockwise in MaterialX's GLSL.
        self.world_frame();
        let mut along = |function: &'static str, axis: &str| {
            let turn = vec![("in", node("float", &half))];
            let turn = self.add(function, &format!("{of}_{function}"), "float", turn);
            let inputs = vec![("in1", node("vector3", axis)), ("in2", node("float", &turn))];
            self.add("multiply", &format!("{of}_{axis}"), "vector3", inputs)
        };
        let (x, y) = (along("cos", "tangent_world"), along("sin", "bitangent_world"));
        let turned = vec![("in1", node("vector3", &x)), ("in2", node("vector3", &y))];
        let turned = self.add("add", &format!("{of}_tangent"), "vector3", turned);
        self.output(strength, "float", length);
        self.output(tangent, "vector3", turned);
    }

    /// Adds tangent and bitangent of the mesh, once.
    fn world_frame(&mut self) {
        if !self.nodes.iter().any(|node| node.name == "tangent_world") {
            let world = || vec![("space", From::Text("string", "world".into()))];
            self.add("tangent", "tangent_world", "vector3", world());
            self.add("bitangent", "bitangent_world", "vector3", world());
        }
    }
}

fn node(kind: &'static str, name: &str) -> From {
    From::Node(kind, name.into())
}

fn number(x: f32) -> From {
    From::Text("float", x.to_string())
}

/// Makes the graph of a material's textures.
fn graph_of(textures: &OpenPbrTextures, names: &MaterialXNames) -> Graph {
    let mut graph = Graph::default();
    for (texture, output) in [
        ("base_color", "base_color"),
        ("specular_color", "specular_color"),
        ("coat_color", "coat_color"),
        ("fuzz_color", "fuzz_color"),
        ("subsurface_color", "subsurface_color"),
    ] {
        if textures.has(texture) {
            let read = graph.texture(names, texture, true);
            graph.output(output, "color3", read);
        }
    }
    graph.normal(names, "normal", "geometry_normal");
    let roughness = graph.texture(names, "roughness", false);
    for (index, output) in ["specular_roughness", "base_diffuse_roughness", "coat_roughness"].into_iter().enumerate() {
        if index < 2 || textures.has("coat") {
            let channel = graph.channel(output, &roughness, index);
            graph.output(output, "float", channel);
        }
    }
    let specular = graph.texture(names, "specular", false);
    graph.anisotropy(&specular, "specular_roughness_anisotropy", "geometry_tangent");
    let root = graph.channel("specular_f0_root", &specular, 2);
    graph.output("specular_f0_root", "float", root.clone());

    // The index of the base under the coat, and its reflectance without weight.
    let mut eta = number(SPECULAR_IOR);
    if textures.has("coat") {
        graph.normal(names, "coat_normal", "geometry_coat_normal");
        let coat = graph.texture(names, "coat", false);
        graph.anisotropy(&coat, "coat_roughness_anisotropy", "geometry_coat_tangent");
        let weight = graph.channel("coat_weight", &coat, 2);
        graph.output("coat_weight", "float", weight.clone());
        let mixed = vec![
            ("fg", number(SPECULAR_IOR / COAT_IOR)),
            ("bg", number(SPECULAR_IOR)),
            ("mix", node("float", &weight)),
        ];
        let mixed = graph.add("mix", "seen_ior", "float", mixed);
        eta = node("float", &mixed);
    }
    let seen = graph.of_two("add", "seen_ior_value", eta, number(0.0));
    let below = graph.of_two("subtract", "seen_ior_less", node("float", &seen), number(1.0));
    let above = graph.of_two("add", "seen_ior_more", node("float", &seen), number(1.0));
    let own = graph.of_two("divide", "seen_f0_root", node("float", &below), node("float", &above));
    let ratio = graph.of_two("divide", "specular_weight_root", node("float", &root), node("float", &own));
    let weight = graph.of_two("multiply", "specular_weight", node("float", &ratio), node("float", &ratio));
    graph.output("specular_weight", "float", weight);
    // The index that a Standard Surface takes for the reflectance.
    let most = vec![("in", node("float", &root)), ("high", number(0.98))];
    let root = graph.add("clamp", "specular_f0_root_cut", "float", most);
    let above = graph.of_two("add", "specular_ior_top", node("float", &root), number(1.0));
    let below = graph.of_two("subtract", "specular_ior_bottom", number(1.0), node("float", &root));
    let index = graph.of_two("divide", "specular_ior", node("float", &above), node("float", &below));
    graph.output("specular_ior", "float", index);

    if textures.has("fuzz") {
        let fuzz = graph.texture(names, "fuzz", false);
        for (index, output) in ["fuzz_weight", "fuzz_roughness"].into_iter().enumerate() {
            let channel = graph.channel(output, &fuzz, index);
            graph.output(output, "float", channel);
        }
    }
    if textures.has("subsurface_weight") {
        let read = graph.texture(names, "subsurface_weight", false);
        let channel = graph.channel("subsurface_share", &read, 0);
        graph.output("subsurface_weight", "float", channel);
    }
    graph
}

/// Returns the inputs of an OpenPBR Surface that the graph feeds, and the constant ones.
fn openpbr_inputs(graph: &Graph) -> Vec<(&'static str, From)> {
    let own = ["specular_f0_root", "specular_ior"];
    let fed = graph.outputs.iter().filter(|(name, _)| !own.contains(name));
    let mut inputs: Vec<(&'static str, From)> =
        fed.map(|(name, (kind, _))| (*name, From::Output(kind, name))).collect();
    inputs.push(("specular_ior", number(SPECULAR_IOR)));
    inputs.push(("coat_ior", number(COAT_IOR)));
    // The colours of the fit are those that are seen through the coat.
    inputs.push(("coat_darkening", number(0.0)));
    if graph.outputs.contains_key("subsurface_weight") {
        inputs.push(("geometry_thin_walled", From::Text("boolean", "true".into())));
        inputs.push(("subsurface_scatter_anisotropy", number(1.0)));
    }
    inputs
}

/// Returns the inputs of a Standard Surface that come nearest.
fn standard_inputs(graph: &Graph) -> Vec<(&'static str, From)> {
    let pairs = [
        ("base_color", "base_color"),
        ("diffuse_roughness", "base_diffuse_roughness"),
        ("specular_color", "specular_color"),
        ("specular_IOR", "specular_ior"),
        ("specular_roughness", "specular_roughness"),
        ("specular_anisotropy", "specular_roughness_anisotropy"),
        ("normal", "geometry_normal"),
        ("tangent", "geometry_tangent"),
        ("coat", "coat_weight"),
        ("coat_color", "coat_color"),
        ("coat_roughness", "coat_roughness"),
        ("coat_anisotropy", "coat_roughness_anisotropy"),
        ("coat_normal", "geometry_coat_normal"),
        ("sheen", "fuzz_weight"),
        ("sheen_color", "fuzz_color"),
        ("sheen_roughness", "fuzz_roughness"),
        ("subsurface", "subsurface_weight"),
        ("subsurface_color", "subsurface_color"),
    ];
    let fed = pairs.into_iter().filter_map(|(input, output)| {
        let (name, (kind, _)) = graph.outputs.get_key_value(output)?;
        Some((input, From::Output(kind, name)))
    });
    let mut inputs: Vec<(&'static str, From)> = fed.collect();
    inputs.push(("base", number(1.0)));
    inputs.push(("specular", number(1.0)));
    inputs.push(("coat_IOR", number(COAT_IOR)));
    if graph.outputs.contains_key("subsurface_weight") {
        inputs.push(("thin_walled", From::Text("boolean", "true".into())));
    }
    inputs
}

/// Writes the document: a graph of the textures, an OpenPBR Surface, a Standard Surface and a material of each. The
/// materials have the attributes `btf_asset`, `btf_checksum` and `btf_size_m`.
///
/// # Errors
/// [`FitError::Params`] if the text cannot be made.
pub fn materialx_document(textures: &OpenPbrTextures, names: &MaterialXNames) -> Result<String, FitError> {
    let graph = graph_of(textures, names);
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
                    From::Text(kind, text) => {
                        let srgb = *kind == "filename" && node.kind == "color3";
                        let element = element.with_attributes([("type", *kind), ("value", text.as_str())]);
                        match srgb {
                            true => element.with_attribute(("colorspace", "srgb_texture")).write_empty()?,
                            false => element.write_empty()?,
                        }
                    }
                    From::Node(kind, name) => {
                        element.with_attributes([("type", *kind), ("nodename", name.as_str())]).write_empty()?
                    }
                    From::Output(kind, output) => element
                        .with_attributes([("type", *kind), ("nodegraph", graph), ("output", name_of(output).as_str())])
                        .write_empty()?,
                };
            }
            Ok(())
        })?;
    Ok(())
}
