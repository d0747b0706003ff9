//! The network that makes the inputs of an OpenPBR Surface of the textures: nodes of MaterialX's standard libraries.

use crate::export::openpbr::model::{COAT_IOR, SPECULAR_IOR};
use crate::export::openpbr::textures::OpenPbrTextures;
use std::collections::BTreeMap;

/// A node's input: its type and where its value comes from.
#[derive(Clone)]
pub enum Source {
    /// A constant.
    Text(&'static str, String),
    /// A node's output.
    Node(&'static str, String),
    /// An output of the graph of textures.
    Output(&'static str, &'static str),
}

/// A node: category, name, type and inputs.
pub struct Node {
    /// Name of the node in the libraries, such as `image`.
    pub category: &'static str,
    /// Name of the node in the graph.
    pub name: String,
    /// Type of its output.
    pub kind: &'static str,
    /// Names of inputs, and what they take.
    pub inputs: Vec<(&'static str, Source)>,
}

/// Nodes that read and unpack the textures, and the graph's outputs with their types.
#[derive(Default)]
pub struct Graph {
    /// The nodes; each takes only from those before it.
    pub nodes: Vec<Node>,
    /// Outputs, by name: their type and the node that makes them.
    pub outputs: BTreeMap<&'static str, (&'static str, String)>,
}

impl Graph {
    /// Adds a node; returns its name.
    fn add(
        &mut self,
        category: &'static str,
        name: &str,
        kind: &'static str,
        inputs: Vec<(&'static str, Source)>,
    ) -> String {
        self.nodes.push(Node { category, name: name.into(), kind, inputs });
        name.into()
    }

    fn output(&mut self, name: &'static str, kind: &'static str, node: String) {
        self.outputs.insert(name, (kind, node));
    }

    /// Adds a texture; returns the node that reads it.
    fn texture(&mut self, prefix: &str, name: &'static str, srgb: bool) -> String {
        let kind = if srgb { "color3" } else { "vector3" };
        let file = Source::Text("filename", format!("{}{name}.png", prefix));
        let mode = |name| (name, Source::Text("string", "periodic".into()));
        self.add("image", name, kind, vec![("file", file), mode("uaddressmode"), mode("vaddressmode")])
    }

    /// Takes a channel of a texture of numbers.
    fn channel(&mut self, name: &str, of: &str, index: usize) -> String {
        let inputs =
            vec![("in", Source::Node("vector3", of.into())), ("index", Source::Text("integer", index.to_string()))];
        self.add("extract", name, "float", inputs)
    }

    /// Adds a node of two numbers.
    fn of_two(&mut self, category: &'static str, name: &str, a: Source, b: Source) -> String {
        self.add(category, name, "float", vec![("in1", a), ("in2", b)])
    }

    /// Unpacks a normal.
    fn normal(&mut self, prefix: &str, texture: &'static str, output: &'static str) {
        let read = self.texture(prefix, texture, false);
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
            let world = || vec![("space", Source::Text("string", "world".into()))];
            self.add("tangent", "tangent_world", "vector3", world());
            self.add("bitangent", "bitangent_world", "vector3", world());
        }
    }
}

fn node(kind: &'static str, name: &str) -> Source {
    Source::Node(kind, name.into())
}

fn number(x: f32) -> Source {
    Source::Text("float", x.to_string())
}

/// Makes the graph of a material's textures.
pub fn graph_of(textures: &OpenPbrTextures, prefix: &str) -> Graph {
    let mut graph = Graph::default();
    for (texture, output) in [
        ("base_color", "base_color"),
        ("specular_color", "specular_color"),
        ("coat_color", "coat_color"),
        ("fuzz_color", "fuzz_color"),
        ("subsurface_color", "subsurface_color"),
    ] {
        if textures.has(texture) {
            let read = graph.texture(prefix, texture, true);
            graph.output(output, "color3", read);
        }
    }
    graph.normal(prefix, "normal", "geometry_normal");
    let roughness = graph.texture(prefix, "roughness", false);
    for (index, output) in ["specular_roughness", "base_diffuse_roughness", "coat_roughness"].into_iter().enumerate() {
        if index < 2 || textures.has("coat") {
            let channel = graph.channel(output, &roughness, index);
            graph.output(output, "float", channel);
        }
    }
    let specular = graph.texture(prefix, "specular", false);
    graph.anisotropy(&specular, "specular_roughness_anisotropy", "geometry_tangent");
    let root = graph.channel("specular_f0_root", &specular, 2);
    graph.output("specular_f0_root", "float", root.clone());

    // The index of the base under the coat, and its reflectance without weight.
    let mut eta = number(SPECULAR_IOR);
    if textures.has("coat") {
        graph.normal(prefix, "coat_normal", "geometry_coat_normal");
        let coat = graph.texture(prefix, "coat", false);
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
    let below = graph.of_two("subtract", "seen_ior_less", eta.clone(), number(1.0));
    let above = graph.of_two("add", "seen_ior_more", eta, number(1.0));
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
        let fuzz = graph.texture(prefix, "fuzz", false);
        for (index, output) in ["fuzz_weight", "fuzz_roughness"].into_iter().enumerate() {
            let channel = graph.channel(output, &fuzz, index);
            graph.output(output, "float", channel);
        }
    }
    if textures.has("subsurface_weight") {
        let read = graph.texture(prefix, "subsurface_weight", false);
        let channel = graph.channel("subsurface_share", &read, 0);
        graph.output("subsurface_weight", "float", channel);
    }
    graph
}

/// Returns the inputs of an OpenPBR Surface that the graph feeds, and the constant ones.
pub fn openpbr_inputs(graph: &Graph) -> Vec<(&'static str, Source)> {
    let own = ["specular_f0_root", "specular_ior"];
    let fed = graph.outputs.iter().filter(|(name, _)| !own.contains(name));
    let mut inputs: Vec<(&'static str, Source)> =
        fed.map(|(name, (kind, _))| (*name, Source::Output(kind, name))).collect();
    inputs.push(("specular_ior", number(SPECULAR_IOR)));
    inputs.push(("coat_ior", number(COAT_IOR)));
    // The colours of the fit are those that are seen through the coat.
    inputs.push(("coat_darkening", number(0.0)));
    if graph.outputs.contains_key("subsurface_weight") {
        inputs.push(("geometry_thin_walled", Source::Text("boolean", "true".into())));
        inputs.push(("subsurface_scatter_anisotropy", number(1.0)));
    }
    inputs
}

/// Returns the inputs of a Standard Surface that come nearest.
pub fn standard_inputs(graph: &Graph) -> Vec<(&'static str, Source)> {
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
        Some((input, Source::Output(kind, name)))
    });
    let mut inputs: Vec<(&'static str, Source)> = fed.collect();
    inputs.push(("base", number(1.0)));
    inputs.push(("specular", number(1.0)));
    inputs.push(("coat_IOR", number(COAT_IOR)));
    if graph.outputs.contains_key("subsurface_weight") {
        inputs.push(("thin_walled", Source::Text("boolean", "true".into())));
    }
    inputs
}
