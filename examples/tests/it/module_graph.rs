//! Which source file of a crate imports which, through modules, items, `use` declarations and paths.
//!
//! Names are resolved through re-exports to the file that defines them, so `crate::Item` counts as an import of the item's own
//! file, not of `lib.rs`. What does not count: a `mod` declaration, a re-export of a descendant (`pub use child::Item`) that
//! the file does not use itself, documentation, and code under `#[cfg(test)]`.

mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use source::{Module, Use, attributes, is_test_only, module_file, name_of, parse};
use syn::Item;
use syn::visit::Visit;

/// Imports between the files of one crate root: from a file to another, with the names that it takes from there.
pub(crate) type Imports = BTreeMap<(PathBuf, PathBuf), BTreeSet<String>>;

/// The files of a crate, found from its root file by following `mod` declarations.
pub(crate) struct ModuleGraph {
    modules: Vec<Module>,
}

/// What a path leads to.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Target {
    Module(usize),
    Item(PathBuf),
}

impl ModuleGraph {
    /// Reads a crate from its root file.
    pub(crate) fn read(root: &Path) -> std::io::Result<Self> {
        let mut graph = Self { modules: Vec::new() };
        let folder = root.parent().unwrap_or(Path::new("")).to_path_buf();
        graph.add(root, &folder, None, &parse(root)?)?;
        Ok(graph)
    }

    /// Adds the module of these items, and those below it; `folder` is where the files of its children lie.
    fn add(&mut self, file: &Path, folder: &Path, parent: Option<usize>, items: &[Item]) -> std::io::Result<usize> {
        let index = self.modules.len();
        self.modules.push(Module {
            file: file.to_path_buf(),
            parent,
            children: BTreeMap::new(),
            items: BTreeSet::new(),
            uses: Vec::new(),
            paths: BTreeSet::new(),
        });
        for item in items.iter().filter(|item| !attributes(item).iter().any(is_test_only)) {
            let Item::Mod(child) = item else {
                self.modules[index].items.extend(name_of(item));
                self.modules[index].visit_item(item);
                continue;
            };
            let name = child.ident.to_string();
            let below = if let Some((_, items)) = &child.content {
                self.add(file, &folder.join(&name), Some(index), items)?
            } else {
                let path = module_file(file, folder, &name, &child.attrs);
                let is_mod_rs = path.file_name().is_some_and(|n| n == "mod.rs");
                let below = if is_mod_rs { path.with_file_name("") } else { path.with_extension("") };
                self.add(&path, &below, Some(index), &parse(&path)?)?
            };
            self.modules[index].children.insert(name, below);
        }
        Ok(index)
    }

    /// What a path leads to from inside a module; nothing if it leaves the crate.
    fn resolve(&self, module: usize, path: &[String], depth: usize) -> BTreeSet<Target> {
        let Some(first) = path.first().filter(|_| depth < 16) else { return BTreeSet::new() };
        let mut found = match first.as_str() {
            "crate" => BTreeSet::from([Target::Module(0)]),
            "self" => BTreeSet::from([Target::Module(module)]),
            "super" => self.modules[module].parent.map(Target::Module).into_iter().collect(),
            name => self.member(module, name, depth + 1),
        };
        for (before, name) in path.iter().zip(&path[1..]) {
            // A function may bear the name of a module beside it; only the module has members.
            if before.starts_with(char::is_lowercase) && found.iter().any(|target| matches!(target, Target::Module(_)))
            {
                found.retain(|target| matches!(target, Target::Module(_)));
            }
            let mut next = BTreeSet::new();
            for target in &found {
                match target {
                    Target::Item(_) => {
                        next.insert(target.clone());
                    }
                    Target::Module(at) if name == "super" => {
                        next.extend(self.modules[*at].parent.map(Target::Module));
                    }
                    Target::Module(at) if name == "self" => {
                        next.insert(Target::Module(*at));
                    }
                    Target::Module(at) => next.extend(self.member(*at, name, depth + 1)),
                }
            }
            // An associated item of a type of the same name as a module is found through the type.
            found = next;
        }
        found
    }

    /// What a name means in a module.
    fn member(&self, module: usize, name: &str, depth: usize) -> BTreeSet<Target> {
        let here = &self.modules[module];
        let mut found = BTreeSet::new();
        if depth > 16 {
            return found;
        }
        found.extend(here.children.get(name).map(|child| Target::Module(*child)));
        if here.items.contains(name) {
            found.insert(Target::Item(here.file.clone()));
        }
        for item in here.uses.iter().filter(|item| item.alias == name) {
            // `use name::name` would look for itself.
            if item.path.first().map(String::as_str) != Some(name) || here.children.contains_key(name) {
                found.extend(self.use_targets(module, item, depth + 1));
            }
        }
        if found.is_empty() {
            for glob in here.uses.iter().filter(|item| item.alias == "*") {
                for target in self.use_targets(module, glob, depth + 1) {
                    if let Target::Module(at) = target
                        && at != module
                    {
                        found.extend(self.member(at, name, depth + 4));
                    }
                }
            }
        }
        found
    }

    fn use_targets(&self, module: usize, item: &Use, depth: usize) -> BTreeSet<Target> {
        // `use run::run`: the first name is the module, not what the declaration brings in.
        let here = &self.modules[module];
        match item.path.split_first() {
            Some((first, rest)) if here.children.contains_key(first) => {
                let child = here.children[first];
                if rest.is_empty() {
                    BTreeSet::from([Target::Module(child)])
                } else {
                    let path: Vec<String> = std::iter::once("self".to_owned()).chain(rest.iter().cloned()).collect();
                    self.resolve(child, &path, depth + 1)
                }
            }
            _ => self.resolve(module, &item.path, depth + 1),
        }
    }

    fn is_ancestor_file(&self, module: usize, file: &Path) -> bool {
        // The modules of that file lie below this one.
        let mine = &self.modules[module].file;
        self.modules.iter().enumerate().filter(|(_, m)| m.file == file).any(|(index, _)| {
            let mut at = Some(index);
            while let Some(k) = at {
                if self.modules[k].file == *mine {
                    return true;
                }
                at = self.modules[k].parent;
            }
            false
        })
    }

    /// How many files the crate has.
    pub(crate) fn files(&self) -> usize {
        self.modules.iter().map(|module| &module.file).collect::<BTreeSet<_>>().len()
    }

    /// All imports from file to file.
    pub(crate) fn imports(&self) -> Imports {
        let mut imports = Imports::new();
        for (index, module) in self.modules.iter().enumerate() {
            let mut add = |targets: BTreeSet<Target>, name: &str| {
                for target in targets {
                    if let Target::Item(file) = target
                        && file != module.file
                    {
                        imports.entry((module.file.clone(), file)).or_default().insert(name.to_owned());
                    }
                }
            };
            for item in &module.uses {
                let targets = self.use_targets(index, item, 0);
                let re_export = |file: &Path| {
                    let used = module.paths.iter().any(|path| path[0] == item.alias);
                    item.public && !used && self.is_ancestor_file(index, file)
                };
                let counted = targets.into_iter().filter(|t| !matches!(t, Target::Item(file) if re_export(file)));
                add(counted.collect(), &item.alias);
            }
            let globs: Vec<usize> = module
                .uses
                .iter()
                .filter(|item| item.alias == "*")
                .flat_map(|item| self.use_targets(index, item, 0))
                .filter_map(|target| if let Target::Module(at) = target { Some(at) } else { None })
                .collect();
            for path in &module.paths {
                let known = path.len() > 1
                    && (["crate", "self", "super"].contains(&path[0].as_str())
                        || module.children.contains_key(&path[0])
                        || module.uses.iter().any(|item| item.alias == path[0]));
                if known {
                    // The module is meant where a module and an item share the name.
                    let first = self.resolve(index, &path[..1], 0);
                    let through = first.iter().any(|t| matches!(t, Target::Module(_)));
                    let targets = self.resolve(index, path, 0);
                    let direct: BTreeSet<Target> = first.into_iter().filter(|t| matches!(t, Target::Item(_))).collect();
                    let targets = if through { targets.difference(&direct).cloned().collect() } else { targets };
                    add(targets, path.last().map_or("", String::as_str));
                } else if !module.items.contains(&path[0]) && !module.uses.iter().any(|item| item.alias == path[0]) {
                    for at in globs.iter().filter(|at| **at != index) {
                        add(self.member(*at, &path[0], 0), &path[0]);
                    }
                }
            }
        }
        imports
    }
}

/// Sets of files that import each other, directly or through others.
pub(crate) fn circles(imports: &Imports) -> Vec<BTreeSet<PathBuf>> {
    let mut reached: BTreeMap<&Path, BTreeSet<&Path>> = BTreeMap::new();
    for (from, _) in imports.keys() {
        let mut seen = BTreeSet::new();
        let mut open = vec![from.as_path()];
        while let Some(at) = open.pop() {
            for (_, to) in imports.keys().filter(|(f, _)| f == at) {
                if seen.insert(to.as_path()) {
                    open.push(to);
                }
            }
        }
        reached.insert(from, seen);
    }
    let mut found: Vec<BTreeSet<PathBuf>> = Vec::new();
    for (from, to) in &reached {
        if to.contains(from) && !found.iter().any(|circle| circle.contains(*from)) {
            let back = |other: &&&Path| reached.get(**other).is_some_and(|r| r.contains(from));
            found.push(to.iter().filter(back).map(|p| p.to_path_buf()).collect());
        }
    }
    found
}

/// Files of a small crate, written, read and searched for circles.
#[cfg(test)]
mod tests {
    use super::{ModuleGraph, circles};
    use crate::scratch::Scratch;

    /// The circles of a crate made of these files, as sorted file stems.
    fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let s = Scratch::new("modules");
        for (name, text) in files {
            s.write(name, text);
        }
        let graph = ModuleGraph::read(&s.0.join("lib.rs")).unwrap();
        assert_eq!(graph.files(), files.len());
        let stem = |path: &std::path::PathBuf| path.file_stem().unwrap().to_string_lossy().into_owned();
        circles(&graph.imports()).iter().map(|circle| circle.iter().map(stem).collect()).collect()
    }

    #[test]
    fn circles_are_found_through_siblings_parents_and_re_exports() {
        let root = ("lib.rs", "mod a; mod b; pub use a::A; pub use b::B;");
        let expected = [["a", "b"]];
        for (a, b) in [
            ("use crate::b::B; pub struct A(B);", "use super::a::A; pub fn b(_: A) {} pub struct B;"),
            // Through the names that the root re-exports, in a path, and renamed.
            ("pub struct A(crate::B);", "use crate::A as Other; pub struct B(Box<Other>);"),
            (
                "use crate::{b::{self, B}}; pub struct A(b::B, B); pub fn f() {}",
                "pub struct B; impl B { fn f() { super::a::f() } }",
            ),
            ("use super::*; pub struct A(B);", "use crate::a; pub struct B; fn f(_: a::A) {}"),
        ] {
            assert_eq!(circles_of(&[root, ("a.rs", a), ("b.rs", b)]), expected, "{a} | {b}");
        }
        // A child that takes from a parent which uses the child, and a ring of three.
        let parent = ("lib.rs", "mod low; pub struct Top; fn f() { low::g(Top) }");
        assert_eq!(circles_of(&[parent, ("low.rs", "use super::Top; pub fn g(_: Top) {}")]), [["lib", "low"]]);
        let ring = [
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "pub use crate::b::X;"),
            ("b.rs", "pub struct X; use crate::c::Y;"),
            ("c.rs", "pub struct Y(super::a::Z);"),
        ];
        assert!(circles_of(&ring).is_empty(), "c takes what a does not have");
        let mut ring = ring;
        ring[1].1 = "pub use crate::b::X; pub struct Z;";
        assert_eq!(circles_of(&ring), [["a", "b", "c"]]);
    }

    #[test]
    fn a_function_that_bears_the_name_of_a_module_has_no_members() {
        let files = [
            ("lib.rs", "mod a; mod b; mod c; pub use b::a;"),
            ("a.rs", "pub struct A;"),
            ("b.rs", "use crate::c::C; pub fn a(_: C) {}"),
            ("c.rs", "use crate::a::A; pub struct C(A);"),
        ];
        assert!(circles_of(&files).is_empty());
    }

    #[test]
    fn re_exports_declarations_tests_and_prose_are_no_imports() {
        for (root, a) in [
            ("mod a; pub use a::f; pub struct Top;", "use super::Top; pub fn f(_: Top) {}"),
            ("mod a; pub struct Top;", "pub fn f(_: crate::Top) {}"),
            ("mod a; pub struct Top; #[cfg(test)] mod tests { use super::a::f; }", "pub fn f(_: crate::Top) {}"),
            ("mod a; /* a::f */ pub struct Top; // a::f\n/// See [`a::f`].\npub struct Doc;", "use super::Top;"),
            ("mod a; pub struct Top; fn f() -> &'static str { \"a::f()\" }", "pub fn f(_: crate::Top) {}"),
        ] {
            assert!(circles_of(&[("lib.rs", root), ("a.rs", a)]).is_empty(), "{root} | {a}");
        }
    }
}
