//! What a reader finds at first glance: few names at the root of a library, short files, thin binaries.

use std::path::{Path, PathBuf};

use syn::{Item, UseTree, Visibility};

use crate::independence::LIBRARIES;

/// Names at the root of a crate; the rest is one level down.
const MOST_NAMES: usize = 25;
/// Lines of a source file, tests and benches included.
const MOST_LINES: usize = 450;
/// Lines of a binary: command line in, result out.
const MOST_LINES_OF_A_BINARY: usize = 100;

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn lines(path: &Path) -> usize {
    std::fs::read_to_string(path).unwrap().lines().count()
}

/// The names that a `use` declaration brings in.
fn names(tree: &UseTree) -> Vec<String> {
    match tree {
        UseTree::Path(path) => names(&path.tree),
        UseTree::Name(name) => vec![name.ident.to_string()],
        UseTree::Rename(renamed) => vec![renamed.rename.to_string()],
        UseTree::Glob(_) => vec!["*".into()],
        UseTree::Group(group) => group.items.iter().flat_map(names).collect(),
    }
}

/// The public names of a root file; what only documentation tests see does not count.
fn public_names(root: &Path) -> Vec<String> {
    let file = syn::parse_file(&std::fs::read_to_string(root).unwrap()).unwrap();
    let public = |visibility: &Visibility| matches!(visibility, Visibility::Public(_));
    let doctest = |attributes: &[syn::Attribute]| {
        attributes.iter().any(|a| a.meta.require_list().is_ok_and(|list| list.tokens.to_string().contains("doctest")))
    };
    let of_item = |item: &Item| match item {
        Item::Use(item) if public(&item.vis) => names(&item.tree),
        Item::Mod(item) if public(&item.vis) && !doctest(&item.attrs) => vec![item.ident.to_string()],
        Item::Struct(item) if public(&item.vis) && !doctest(&item.attrs) => vec![item.ident.to_string()],
        Item::Enum(item) if public(&item.vis) => vec![item.ident.to_string()],
        Item::Trait(item) if public(&item.vis) => vec![item.ident.to_string()],
        Item::Fn(item) if public(&item.vis) => vec![item.sig.ident.to_string()],
        Item::Type(item) if public(&item.vis) => vec![item.ident.to_string()],
        Item::Const(item) if public(&item.vis) => vec![item.ident.to_string()],
        _ => Vec::new(),
    };
    file.items.iter().flat_map(of_item).collect()
}

#[test]
fn the_roots_of_the_libraries_have_few_names() {
    for library in LIBRARIES {
        let names = public_names(&workspace().join(library).join("src/lib.rs"));
        assert!(names.len() >= 10, "{library}: {names:?}: the scan sees less than there is");
        assert!(names.len() <= MOST_NAMES, "{library} has {} names at its root: {names:?}", names.len());
        assert!(!names.contains(&"*".to_owned()), "{library}: what a glob brings to the root cannot be seen in lib.rs");
    }
}

/// docs.rs shows no features by itself: the table in the crate's documentation has a row for each.
#[test]
fn every_feature_of_a_library_is_in_its_table() {
    for library in LIBRARIES {
        let folder = workspace().join(library);
        let manifest: toml::Table = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap().parse().unwrap();
        let text = std::fs::read_to_string(folder.join("src/lib.rs")).unwrap();
        let features = manifest["features"].as_table().unwrap();
        let mut named: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("//! | `")).collect();
        named.retain(|row| features.contains_key(row.split('`').next().unwrap()));
        let expected = features.keys().filter(|feature| *feature != "default").count();
        assert_eq!(named.len(), expected, "{library}: {named:?}");
    }
}

#[test]
fn files_are_short() {
    let mut found = Vec::new();
    for package in LIBRARIES.into_iter().chain(["examples", "benches"]) {
        sources(&workspace().join(package), &mut found);
    }
    assert!(found.len() > 500, "{} files", found.len());
    let long: Vec<_> = found.iter().map(|path| (lines(path), path)).filter(|(lines, _)| *lines > MOST_LINES).collect();
    assert!(long.is_empty(), "more than {MOST_LINES} lines: {long:?}");
}

#[test]
fn binaries_are_thin() {
    let mut found = Vec::new();
    sources(&workspace().join("examples/src/bin"), &mut found);
    assert!(found.len() >= 8, "{found:?}");
    for path in found {
        let lines = lines(&path);
        assert!(lines <= MOST_LINES_OF_A_BINARY, "{} has {lines} lines", path.display());
    }
}
