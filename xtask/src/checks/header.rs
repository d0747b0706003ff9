//! The C header, made by cbindgen from the sources of the C interface: writes it, and checks that the repository has it
//! as it is made.

use crate::failure::Failure;
use crate::shell::root;
use std::path::Path;

/// The folder of the C interface, relative to the repository's root.
const PACKAGE: &str = "runtime/c";
/// The header, relative to the package.
const HEADER: &str = "include/btf.h";
/// The sources in the order of their parts in the header. Files with nothing that C sees are not listed.
const SOURCES: [&str; 3] = ["src/code.rs", "src/asset.rs", "src/evaluate.rs"];
/// Variants of the enum of codes are `BTF_OK`, not `BTF_CODE_OK`: an error code is known by its prefix alone.
const SHORTER: (&str, &str) = ("BTF_CODE_", "BTF_");

/// Writes the header into the repository. Returns one line that names the file.
pub fn write() -> Result<String, Failure> {
    let path = root().join(PACKAGE).join(HEADER);
    let text = header_of(&root().join(PACKAGE))?;
    let cannot = |error| Failure::new(format!("{} cannot be written: {error}", path.display()));
    std::fs::create_dir_all(path.parent().unwrap_or(Path::new("."))).map_err(cannot)?;
    std::fs::write(&path, text).map_err(cannot)?;
    Ok(format!("wrote {PACKAGE}/{HEADER}"))
}

/// Checks that the header in the repository is what its sources make. `Ok` holds one line, `Err` the first difference.
pub fn check() -> Result<String, String> {
    let package = root().join(PACKAGE);
    let made = header_of(&package).map_err(|failure| failure.to_string())?;
    let present = std::fs::read_to_string(package.join(HEADER))
        .map_err(|error| format!("{PACKAGE}/{HEADER} cannot be read: {error}; write it with `cargo xtask header`"))?;
    match difference(&made, &present) {
        None => Ok(format!("{PACKAGE}/{HEADER} is what its sources make, {} lines", present.lines().count())),
        Some(difference) => Err(difference),
    }
}

/// Returns the header that the sources in `package` make.
fn header_of(package: &Path) -> Result<String, Failure> {
    let config = cbindgen::Config::from_file(package.join("cbindgen.toml"))
        .map_err(|reason| Failure::new(format!("{PACKAGE}/cbindgen.toml is not right: {reason}")))?;
    let sources = SOURCES
        .iter()
        .fold(cbindgen::Builder::new().with_config(config), |builder, source| builder.with_src(package.join(source)));
    let bindings = sources.generate().map_err(|error| Failure::new(format!("no header can be made: {error}")))?;
    let mut text = Vec::new();
    bindings.write(&mut text);
    let text = String::from_utf8(text).map_err(|_| Failure::new("cbindgen wrote a header that is not UTF-8"))?;
    Ok(text.replace(SHORTER.0, SHORTER.1))
}

/// Returns the first difference of the header in the repository from the one that was made.
fn difference(made: &str, present: &str) -> Option<String> {
    let (mut made, mut present) = (made.lines(), present.lines());
    let mut number = 1;
    loop {
        let (expected, found) = (made.next(), present.next());
        if expected.is_none() && found.is_none() {
            return None;
        }
        if expected != found {
            let line = |line: Option<&str>| line.map_or("the end".to_string(), |line| format!("'{line}'"));
            return Some(format!(
                "{PACKAGE}/{HEADER}:{number} is {}, the sources make {}: run `cargo xtask header`",
                line(found),
                line(expected)
            ));
        }
        number += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_in_the_repository_is_what_the_sources_make() {
        assert!(check().is_ok_and(|sentence| sentence.contains("lines")), "{:?}", check());
        let made = header_of(&root().join(PACKAGE)).unwrap();
        // Planted differences: a changed type, a line that is gone, one that is too many.
        let changed = made.replacen("uint32_t level", "uint64_t level", 1);
        assert!(difference(&made, &changed).is_some_and(|sentence| sentence.contains("uint64_t level")));
        assert!(difference(&made, made.trim_end().rsplit_once('\n').unwrap().0).is_some());
        assert!(difference(&made, &format!("{made}int more;\n")).is_some());
    }

    #[test]
    fn every_function_that_c_can_call_stands_in_the_header() {
        let package = root().join(PACKAGE);
        let header = std::fs::read_to_string(package.join(HEADER)).unwrap();
        let mut seen = 0;
        for entry in std::fs::read_dir(package.join("src")).unwrap() {
            let path = entry.unwrap().path();
            // Memory for hosts of WebAssembly: no other target has these functions.
            if path.ends_with("memory.rs") {
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap();
            for part in text.split("#[unsafe(no_mangle)]").skip(1) {
                let name = part.split_once("fn ").unwrap().1.split('(').next().unwrap();
                assert!(header.contains(&format!("{name}(")), "{name} is not in the header: see SOURCES");
                seen += 1;
            }
        }
        assert!(seen >= 12, "{seen}");
    }
}
