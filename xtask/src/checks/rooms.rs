//! Checks the folders inside the packages: their modules use each other without cycles, no folder is crowded, no
//! function is long.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syn::spanned::Spanned;
use syn::visit::Visit;

/// The packages whose `src` is checked, as folders of the repository.
const PACKAGES: [&str; 11] = [
    "capture",
    "models",
    "models/leaf-quantities",
    "datasets-synth",
    "fit",
    "fit/voxelize",
    "runtime",
    "runtime/shaders",
    "runtime/textures",
    "viewer",
    "xtask",
];

/// Source files beside each other in a folder at most; the tests of a file do not count.
const MAX_FILES: usize = 20;
/// Lines of a function at most, its signature and braces among them.
const MAX_FUNCTION_LINES: usize = 100;
/// Folder names that say nothing.
const EMPTY_NAMES: [&str; 5] = ["misc", "util", "utils", "common", "helpers"];
/// The one direction between rooms that a cycle would not show: the reference renderer stands without the GPU's.
const FORBIDDEN: [(&str, &str, &str); 1] = [("viewer", "cpu/", "gpu/")];
/// Cycles between files that stay, each with its reason: (package, files, reason).
const ALLOWED_CYCLES: [(&str, &[&str], &str); 0] = [];

/// Checks every package. `Ok` holds one line that says what was read; `Err` every offence, one a line.
pub fn check(root: &Path) -> Result<String, String> {
    let (mut offences, mut files, mut arrows) = (Vec::new(), 0, 0);
    for package in PACKAGES {
        let sources = sources_of(&root.join(package).join("src"))?;
        let (found, graph) = examine(package, &sources)?;
        offences.extend(found);
        files += sources.len();
        arrows += graph.values().map(BTreeMap::len).sum::<usize>();
    }
    match offences.is_empty() {
        true => Ok(format!("{files} files with {arrows} arrows between them in {} packages: no cycle", PACKAGES.len())),
        false => Err(offences.join("\n")),
    }
}

/// Source files as `[(path below src, text)]`, sorted. WGSL files are listed with an empty text, because they fill a
/// folder, too.
type Sources = Vec<(String, String)>;
/// The names that each file uses of each other file.
type Graph = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

fn sources_of(src: &Path) -> Result<Sources, String> {
    let mut files = Vec::new();
    let mut folders = vec![src.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let unreadable = |error: std::io::Error| format!("{} is not readable: {error}", folder.display());
        for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
            let path: PathBuf = entry.map_err(unreadable)?.path();
            let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
            let name = path.strip_prefix(src).unwrap_or(&path).to_string_lossy().replace('\\', "/");
            match ending {
                _ if path.is_dir() => folders.push(path),
                "rs" => files.push((name, std::fs::read_to_string(&path).map_err(unreadable)?)),
                "wgsl" => files.push((name, String::new())),
                _ => {}
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Checks one package from its sources.
fn examine(package: &str, sources: &Sources) -> Result<(Vec<String>, Graph), String> {
    let mut parsed = Vec::new();
    for (name, text) in sources.iter().filter(|(name, _)| name.ends_with(".rs")) {
        let syntax = syn::parse_file(text).map_err(|error| format!("{package}/src/{name}: {error}"))?;
        parsed.push(Module::of(name, &syntax));
    }
    let only_tests: BTreeSet<Vec<String>> = parsed.iter().flat_map(|module| module.test_modules.clone()).collect();
    parsed.retain(|module| !only_tests.iter().any(|tests| module.path.starts_with(tests)));
    let graph = graph_of(&parsed);
    let mut offences = crowded_folders(package, sources);
    offences.extend(long_functions(package, &parsed));
    offences.extend(forbidden_arrows(package, &graph));
    offences.extend(cycles(package, &graph));
    Ok((offences, graph))
}

/// A file as a module of its package.
struct Module {
    /// Path of the file below `src`.
    file: String,
    /// Path of the module from the root of the package.
    path: Vec<String>,
    /// Names of the items that the module defines.
    items: BTreeSet<String>,
    /// Names that the module imports.
    imports: Vec<Import>,
    /// Paths in the module's code, tests left out.
    mentions: Vec<Vec<String>>,
    /// Modules that the module declares for tests alone.
    test_modules: Vec<Vec<String>>,
    /// Name and number of lines of each function.
    functions: Vec<(String, usize)>,
}

struct Import {
    name: String,
    path: Vec<String>,
    exported: bool,
}

impl Module {
    fn of(file: &str, syntax: &syn::File) -> Module {
        let stem = file.trim_end_matches(".rs");
        let mut path: Vec<String> = stem.split('/').map(String::from).collect();
        if path.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
            path.pop();
        }
        let mut module = Module {
            file: file.into(),
            path,
            items: BTreeSet::new(),
            imports: Vec::new(),
            mentions: Vec::new(),
            test_modules: Vec::new(),
            functions: Vec::new(),
        };
        syntax.items.iter().for_each(|item| module.visit_item(item));
        module
    }

    /// Adds what a `use` brings in, with `self` and `super` resolved.
    fn import(&mut self, tree: &syn::UseTree, mut prefix: Vec<String>, exported: bool) {
        match tree {
            syn::UseTree::Path(part) => {
                prefix.push(part.ident.to_string());
                self.import(&part.tree, prefix, exported);
            }
            syn::UseTree::Group(group) => {
                group.items.iter().for_each(|tree| self.import(tree, prefix.clone(), exported));
            }
            syn::UseTree::Name(name) if name.ident == "self" => {
                let name = prefix.last().cloned().unwrap_or_default();
                self.imports.push(Import { name, path: prefix, exported });
            }
            syn::UseTree::Name(name) => {
                let name = name.ident.to_string();
                prefix.push(name.clone());
                self.imports.push(Import { name, path: prefix, exported });
            }
            syn::UseTree::Rename(rename) => {
                if rename.ident != "self" {
                    prefix.push(rename.ident.to_string());
                }
                self.imports.push(Import { name: rename.rename.to_string(), path: prefix, exported });
            }
            syn::UseTree::Glob(_) => {
                prefix.push("*".into());
                self.imports.push(Import { name: "*".into(), path: prefix, exported });
            }
        }
    }

    /// Finds paths in the arguments of a macro, which no parser knows the form of.
    fn mention_tokens(&mut self, tokens: proc_macro2::TokenStream) {
        let mut path: Vec<String> = Vec::new();
        let mut colons = 0;
        for token in tokens {
            match token {
                proc_macro2::TokenTree::Ident(name) => {
                    if colons != 2 {
                        self.mentions.push(std::mem::take(&mut path));
                    }
                    path.push(name.to_string());
                    colons = 0;
                }
                proc_macro2::TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                other => {
                    self.mentions.push(std::mem::take(&mut path));
                    colons = 0;
                    if let proc_macro2::TokenTree::Group(group) = other {
                        self.mention_tokens(group.stream());
                    }
                }
            }
        }
        self.mentions.push(path);
    }

    fn measure(&mut self, name: &syn::Ident, span: proc_macro2::Span) {
        self.functions.push((name.to_string(), span.end().line + 1 - span.start().line));
    }
}

/// Returns whether an item is compiled for tests alone.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        syn::Meta::Path(path) => path.is_ident("test"),
        syn::Meta::List(list) => list.path.is_ident("cfg") && list.tokens.to_string() == "test",
        syn::Meta::NameValue(_) => false,
    })
}

impl<'ast> Visit<'ast> for Module {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        use syn::Item;
        let (name, attributes) = match item {
            Item::Const(item) => (Some(&item.ident), &item.attrs),
            Item::Enum(item) => (Some(&item.ident), &item.attrs),
            Item::Fn(item) => (Some(&item.sig.ident), &item.attrs),
            Item::Mod(item) => (Some(&item.ident), &item.attrs),
            Item::Static(item) => (Some(&item.ident), &item.attrs),
            Item::Struct(item) => (Some(&item.ident), &item.attrs),
            Item::Trait(item) => (Some(&item.ident), &item.attrs),
            Item::Type(item) => (Some(&item.ident), &item.attrs),
            Item::Macro(item) => (item.ident.as_ref(), &item.attrs),
            Item::Impl(item) => (None, &item.attrs),
            Item::Use(item) => (None, &item.attrs),
            _ => return,
        };
        if is_test(attributes) {
            if let Item::Mod(item) = item {
                self.test_modules.push([self.path.clone(), vec![item.ident.to_string()]].concat());
            }
            return;
        }
        match item {
            Item::Mod(declared) if declared.content.is_none() => return,
            Item::Use(item) => {
                let exported = !matches!(item.vis, syn::Visibility::Inherited);
                self.import(&item.tree, Vec::new(), exported);
                return;
            }
            Item::Fn(function) => self.measure(&function.sig.ident, function.span()),
            _ => {}
        }
        self.items.extend(name.map(ToString::to_string));
        syn::visit::visit_item(self, item);
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if !is_test(&function.attrs) {
            self.measure(&function.sig.ident, function.span());
            syn::visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        self.import(&item.tree, Vec::new(), false);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.mentions.push(path.segments.iter().map(|segment| segment.ident.to_string()).collect());
        syn::visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'ast syn::Macro) {
        self.mention_tokens(item.tokens.clone());
    }
}

/// Resolves names to the files that define them.
struct Names<'a> {
    modules: BTreeMap<&'a [String], &'a Module>,
}

impl<'a> Names<'a> {
    /// Resolves a path in the code of `module` to a path from the root of the package. Returns `None` for other crates
    /// and local names.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Vec<String>> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => Some(rest.to_vec()),
            "self" => Some([&module.path[..], rest].concat()),
            "super" => {
                let above = path.iter().take_while(|part| *part == "super").count();
                let base = module.path.len().checked_sub(above)?;
                Some([&module.path[..base], &path[above..]].concat())
            }
            name => {
                let import = module.imports.iter().find(|import| import.name == name && import.path[0] != name);
                if let Some(import) = import {
                    return Some([self.absolute(module, &import.path)?, rest.to_vec()].concat());
                }
                let child = [&module.path[..], std::slice::from_ref(first)].concat();
                self.modules.contains_key(&child[..]).then(|| [child, rest.to_vec()].concat())
            }
        }
    }

    /// Returns the file that defines what an absolute path names, or `None` where the path names a module.
    fn file_of(&self, path: &[String], depth: usize) -> Option<&'a str> {
        let deepest = (0..=path.len()).rev().find(|&length| self.modules.contains_key(&path[..length]))?;
        let module = self.modules[&path[..deepest]];
        let name = path.get(deepest)?;
        if module.items.contains(name) || depth > 8 {
            return Some(&module.file);
        }
        let exports = module.imports.iter().filter(|import| import.exported && import.name == *name);
        for import in exports {
            if let Some(target) = self.absolute(module, &import.path) {
                return self.file_of(&target, depth + 1);
            }
        }
        for import in module.imports.iter().filter(|import| import.name == "*") {
            let target = self.absolute(module, &import.path).map(|mut target| {
                target.pop();
                target.push(name.clone());
                target
            });
            if let Some(file) = target.and_then(|target| self.file_of(&target, depth + 1)) {
                return Some(file);
            }
        }
        None
    }
}

fn graph_of(modules: &[Module]) -> Graph {
    let names = Names {
        modules: modules
            .iter()
            .filter(|module| module.file != "main.rs")
            .map(|module| (&module.path[..], module))
            .collect(),
    };
    let mut graph = Graph::new();
    for module in modules.iter().filter(|module| !module.path.is_empty()) {
        // What a folder's own file hands on to its users is not what it uses.
        let is_folder = module.file.ends_with("mod.rs");
        let imports = module.imports.iter().filter(|import| !(is_folder && import.exported)).map(|import| &import.path);
        for path in imports.chain(&module.mentions) {
            let target = names.absolute(module, path).and_then(|path| Some((names.file_of(&path, 0)?, path)));
            if let Some((file, path)) = target
                && file != module.file
            {
                let named = path.last().cloned().unwrap_or_default();
                graph.entry(module.file.clone()).or_default().entry(file.into()).or_default().insert(named);
            }
        }
    }
    graph
}

/// Finds folders with too many files beside each other, and folders with a name that says nothing.
fn crowded_folders(package: &str, sources: &Sources) -> Vec<String> {
    let mut folders: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (file, _) in sources {
        let (folder, name) = file.rsplit_once('/').unwrap_or(("", file));
        // Twins in Rust and WGSL are one noun.
        let stem = name.trim_end_matches(".rs").trim_end_matches(".wgsl");
        if !["mod", "lib", "main", "tests"].contains(&stem) {
            folders.entry(folder).or_default().insert(stem);
        }
    }
    let mut offences = Vec::new();
    for (folder, files) in folders {
        if files.len() > MAX_FILES {
            offences.push(format!(
                "{package}/src/{folder} has {} files, and {MAX_FILES} are the most that one sees at a glance: make a folder of \
                 those that belong together",
                files.len()
            ));
        }
        if let Some(name) = folder.split('/').find(|name| EMPTY_NAMES.contains(name)) {
            offences
                .push(format!("{package}/src/{folder}: '{name}' says nothing; name the folder after what is in it"));
        }
    }
    offences
}

fn long_functions(package: &str, modules: &[Module]) -> Vec<String> {
    let functions = modules.iter().flat_map(|module| module.functions.iter().map(move |function| (module, function)));
    functions
        .filter(|(_, (_, lines))| *lines > MAX_FUNCTION_LINES)
        .map(|(module, (name, lines))| {
            format!(
                "{package}/src/{}: `{name}` has {lines} lines, at most {MAX_FUNCTION_LINES} are wanted: give its steps names",
                module.file
            )
        })
        .collect()
}

fn forbidden_arrows(package: &str, graph: &Graph) -> Vec<String> {
    let mut offences = Vec::new();
    for (_, from, to) in FORBIDDEN.iter().filter(|(of, _, _)| *of == package) {
        for (file, uses) in graph.iter().filter(|(file, _)| file.starts_with(from)) {
            for (other, names) in uses.iter().filter(|(other, _)| other.starts_with(to)) {
                offences.push(format!("{package}/src/{file} uses {other} ({}), which it must not", list(names)));
            }
        }
    }
    offences
}

/// Finds cycles between the files of a package, and between its folders at every depth.
fn cycles(package: &str, graph: &Graph) -> Vec<String> {
    let mut offences = Vec::new();
    let allowed = |files: &[&str]| {
        ALLOWED_CYCLES.iter().any(|(of, known, _)| *of == package && files.iter().all(|file| known.contains(file)))
    };
    let whole: BTreeMap<&str, BTreeSet<&str>> =
        graph.iter().map(|(file, uses)| (file.as_str(), uses.keys().map(String::as_str).collect())).collect();
    for circle in circles(&whole).into_iter().filter(|circle| !allowed(circle)) {
        offences.push(told(package, "files", &circle, graph, |file| file));
    }
    let parents: BTreeSet<&str> = graph.keys().flat_map(|file| ancestors(file)).collect();
    for parent in parents {
        let inside = |file: &'_ str| file.starts_with(parent);
        // A child of `parent`: a folder below it, or a file beside those.
        let mut between: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
        for (file, uses) in graph.iter().filter(|(file, _)| inside(file)) {
            let targets = uses.keys().filter(|other| inside(other)).map(|other| child(parent, other));
            between
                .entry(child(parent, file))
                .or_default()
                .extend(targets.filter(|other| *other != child(parent, file)));
        }
        for circle in circles(&between).into_iter().filter(|circle| circle.iter().any(|room| room.ends_with('/'))) {
            offences.push(told(package, "folders", &circle, graph, |file| {
                if inside(file) { child(parent, file) } else { file }
            }));
        }
    }
    offences
}

/// Returns the folders that a file lies in, outermost first: "", "a/", "a/b/".
fn ancestors(file: &str) -> Vec<&str> {
    std::iter::once("").chain(file.match_indices('/').map(|(at, _)| &file[..=at])).collect()
}

/// Returns what lies directly in `parent` and holds `file`: a folder with its slash, or the file itself.
fn child<'a>(parent: &str, file: &'a str) -> &'a str {
    let below = &file[parent.len()..];
    below.find('/').map_or(file, |at| &file[..=parent.len() + at])
}

fn told<'a>(package: &str, what: &str, circle: &[&str], graph: &'a Graph, room: impl Fn(&'a str) -> &'a str) -> String {
    let mut arrows = Vec::new();
    for (file, uses) in graph {
        for (other, names) in uses {
            let (from, to) = (room(file), room(other));
            if from != to && circle.contains(&from) && circle.contains(&to) {
                arrows.push(format!("  {file} -> {other}: {}", list(names)));
            }
        }
    }
    format!("{package}/src: {what} {} use each other in a circle:\n{}", circle.join(", "), arrows.join("\n"))
}

fn list(names: &BTreeSet<String>) -> String {
    names.iter().map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// Finds the strongly connected components of more than one node [Tarjan 1972]. Sorts each.
fn circles<'a>(graph: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> Vec<Vec<&'a str>> {
    /// The numbering of one search.
    struct Search<'a, 'g> {
        graph: &'g BTreeMap<&'a str, BTreeSet<&'a str>>,
        number: BTreeMap<&'a str, (usize, usize)>,
        open: Vec<&'a str>,
        found: Vec<Vec<&'a str>>,
    }
    impl<'a> Search<'a, '_> {
        fn from(&mut self, node: &'a str) {
            let own = self.number.len();
            self.number.insert(node, (own, own));
            self.open.push(node);
            let graph = self.graph;
            for other in graph.get(node).into_iter().flatten() {
                match self.number.get(other) {
                    None => {
                        self.from(other);
                        let lowest = self.number[other].1.min(self.number[node].1);
                        self.number.insert(node, (own, lowest));
                    }
                    Some((number, _)) if self.open.contains(other) => {
                        let lowest = (*number).min(self.number[node].1);
                        self.number.insert(node, (own, lowest));
                    }
                    Some(_) => {}
                }
            }
            if self.number[node].1 == own {
                let at = self.open.iter().position(|open| *open == node).unwrap_or_default();
                let mut circle = self.open.split_off(at);
                circle.sort_unstable();
                if circle.len() > 1 {
                    self.found.push(circle);
                }
            }
        }
    }
    let mut search = Search { graph, number: BTreeMap::new(), open: Vec::new(), found: Vec::new() };
    for node in graph.keys() {
        if !search.number.contains_key(node) {
            search.from(node);
        }
    }
    search.found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offences(files: &[(&str, &str)]) -> Vec<String> {
        let sources = files.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect();
        examine("viewer", &sources).unwrap().0
    }

    const LIB: (&str, &str) = ("lib.rs", "mod cpu; mod gpu; pub use gpu::frame::Frame;");
    const ROOMS: [(&str, &str); 2] = [("cpu/mod.rs", "pub mod pixel;"), ("gpu/mod.rs", "pub mod frame; pub mod pass;")];

    #[test]
    fn a_planted_cycle_between_folders_is_found_and_its_absence_is_not() {
        let good = [
            LIB,
            ROOMS[0],
            ROOMS[1],
            ("cpu/pixel.rs", "pub struct Pixel;"),
            ("gpu/frame.rs", "use crate::cpu::pixel::Pixel; pub struct Frame(Pixel);"),
            ("gpu/pass.rs", "use crate::Frame; fn f(_: Frame) {}"),
        ];
        assert_eq!(offences(&good), Vec::<String>::new());
        let mut bad = good;
        // Through the package's own public name, and through another file of the folder than the one that closes the
        // circle.
        bad[3].1 = "use crate::gpu; pub struct Pixel; fn f() { gpu::pass::run() }";
        bad[5].1 = "pub fn run() {}";
        let found = offences(&bad);
        assert!(found.iter().any(|line| line.contains("folders cpu/, gpu/ use each other")), "{found:?}");
        assert!(!found.iter().any(|line| line.contains("files ")), "no file closes it alone: {found:?}");
    }

    #[test]
    fn a_planted_cycle_between_files_is_found_inside_macros_too() {
        let found = offences(&[
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "pub const A: u32 = 1; fn f() { println!(\"{}\", crate::b::B) }"),
            ("b.rs", "pub const B: u32 = super::a::A;"),
        ]);
        assert!(found.len() == 1 && found[0].contains("files a.rs, b.rs"), "{found:?}");
        let only_in_tests = offences(&[
            ("lib.rs", "mod a; mod b;"),
            ("a.rs", "pub const A: u32 = 1; #[cfg(test)] mod tests { use crate::b::B; }"),
            ("b.rs", "pub const B: u32 = super::a::A;"),
        ]);
        assert_eq!(only_in_tests, Vec::<String>::new());
    }

    #[test]
    fn the_reference_renderer_may_not_use_the_gpus() {
        let found = offences(&[
            LIB,
            ROOMS[0],
            ROOMS[1],
            ("cpu/pixel.rs", "use crate::Frame; fn f(_: Frame) {}"),
            ("gpu/frame.rs", "pub struct Frame;"),
            ("gpu/pass.rs", ""),
        ]);
        assert!(found.len() == 1 && found[0].contains("cpu/pixel.rs uses gpu/frame.rs (Frame)"), "{found:?}");
    }

    #[test]
    fn crowded_folders_empty_names_and_long_functions_are_found() {
        let many: Vec<(String, &str)> = (0..=MAX_FILES).map(|i| (format!("a{i}.rs"), "")).collect();
        let many: Vec<(&str, &str)> = many.iter().map(|(name, text)| (name.as_str(), *text)).collect();
        assert!(offences(&many)[0].contains("21 files"));
        assert_eq!(offences(&many[1..]), Vec::<String>::new());
        assert!(offences(&[("util/a.rs", "")])[0].contains("'util' says nothing"));
        let long = format!("fn f() {{\n{}}}", "g();\n".repeat(MAX_FUNCTION_LINES - 1));
        assert!(offences(&[("a.rs", &long)])[0].contains("`f` has 101 lines"));
        assert_eq!(offences(&[("a.rs", &long.replacen("g();\n", "", 1))]), Vec::<String>::new());
    }
}
