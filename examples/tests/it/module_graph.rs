//! Which source file of a crate imports which, read from the text: modules, items, `use` declarations and paths.
//!
//! Names are resolved through re-exports to the file that defines them, so `crate::Item` counts as an import of the item's own
//! file, not of `lib.rs`. What does not count: a `mod` declaration, a re-export of a descendant (`pub use child::Item`) that
//! the file does not use itself, documentation, and code under `#[cfg(test)]`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Imports between the files of one crate root: from a file to another, with the names that it takes from there.
pub(crate) type Imports = BTreeMap<(PathBuf, PathBuf), BTreeSet<String>>;

/// The files of a crate, found from its root file by following `mod` declarations.
pub(crate) struct ModuleGraph {
    modules: Vec<Module>,
}

struct Module {
    file: PathBuf,
    parent: Option<usize>,
    children: BTreeMap<String, usize>,
    items: BTreeSet<String>,
    uses: Vec<Use>,
    /// All paths in the code, single identifiers included, `use` declarations left out.
    paths: BTreeSet<Vec<String>>,
}

/// One name that a `use` declaration brings in.
struct Use {
    path: Vec<String>,
    /// The name it has here; `*` for all names of a module.
    alias: String,
    public: bool,
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
        let tokens = tokens(&std::fs::read_to_string(root)?);
        graph.add(root, &folder, None, &tokens)?;
        Ok(graph)
    }

    /// Adds the module of these tokens, and those below it; `folder` is where the files of its children lie.
    fn add(&mut self, file: &Path, folder: &Path, parent: Option<usize>, tokens: &[String]) -> std::io::Result<usize> {
        let index = self.modules.len();
        self.modules.push(Module {
            file: file.to_path_buf(),
            parent,
            children: BTreeMap::new(),
            items: BTreeSet::new(),
            uses: Vec::new(),
            paths: BTreeSet::new(),
        });
        let (mut at, mut depth, mut explicit) = (0, 0_usize, None);
        while at < tokens.len() {
            let word = tokens[at].as_str();
            let next = tokens.get(at + 1).map_or("", String::as_str);
            match word {
                "#" => {
                    let end = attribute_end(tokens, at);
                    let attribute = &tokens[at..end];
                    if is_test_only(attribute) {
                        at = item_end(tokens, end);
                        continue;
                    }
                    // `#[path = "file.rs"]`: strings are kept with their quotes.
                    if attribute.iter().any(|t| t == "path") {
                        explicit =
                            attribute.iter().find(|t| t.starts_with('"')).map(|t| t.trim_matches('"').to_owned());
                    }
                    at = end;
                    continue;
                }
                "{" => depth += 1,
                "}" => depth = depth.saturating_sub(1),
                // Not the `use<...>` of a type.
                "use" if next != "<" => {
                    let end = tokens[at..].iter().position(|t| t == ";").map_or(tokens.len(), |k| at + k);
                    let public = at > 0 && (tokens[at - 1] == "pub" || tokens[at - 1] == ")");
                    use_tree(&tokens[at + 1..end], &[], public, &mut self.modules[index].uses);
                    at = end;
                }
                "mod" if depth == 0 && is_name(next) => {
                    let child = if tokens.get(at + 2).is_some_and(|t| t == "{") {
                        let end = block_end(tokens, at + 2);
                        let below = &tokens[at + 3..end - 1];
                        at = end - 1;
                        self.add(file, &folder.join(next), Some(index), below)?
                    } else {
                        let path = module_file(file, folder, next, explicit.take().as_deref());
                        let is_mod_rs = path.file_name().is_some_and(|n| n == "mod.rs");
                        let below = if is_mod_rs { path.with_file_name("") } else { path.with_extension("") };
                        let text = std::fs::read_to_string(&path);
                        let in_file =
                            |e: std::io::Error| std::io::Error::new(e.kind(), format!("{}: {e}", path.display()));
                        at += 1;
                        self.add(&path, &below, Some(index), &self::tokens(&text.map_err(in_file)?))?
                    };
                    self.modules[index].children.insert(next.to_owned(), child);
                }
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static"
                    if depth == 0 && is_name(next) && !["fn", "unsafe", "extern", "mut", "_"].contains(&next) =>
                {
                    self.modules[index].items.insert(next.to_owned());
                    at += 1;
                }
                "macro_rules" if next == "!" => {
                    let name = tokens.get(at + 2).cloned().unwrap_or_default();
                    self.modules[index].items.insert(name);
                    at = block_end(tokens, at + 3) - 1;
                }
                "pub" if next == "(" => {
                    // The place in `pub(in ...)` is no import; `use` asks for the bracket.
                    at += tokens[at..].iter().position(|t| t == ")").unwrap_or(0);
                }
                _ if is_name(word) && !(at > 0 && (tokens[at - 1] == "." || tokens[at - 1] == "::")) => {
                    let (path, end) = path_at(tokens, at);
                    self.modules[index].paths.insert(path);
                    at = end;
                    continue;
                }
                _ => {}
            }
            at += 1;
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

/// Words, numbers, strings with their quotes, `::` and single signs; comments left out.
fn tokens(text: &str) -> Vec<String> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &text[at..];
        let c = bytes[at];
        if rest.starts_with("//") {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if rest.starts_with("/*") {
            at += block_comment(rest);
        } else if let Some(length) = raw_string(rest) {
            found.push("\"\"".to_owned());
            at += length;
        } else if c == b'"' || rest.starts_with("b\"") || rest.starts_with("c\"") {
            let start = at + usize::from(c != b'"');
            let mut end = start + 1;
            while end < bytes.len() && bytes[end] != b'"' {
                end += 1 + usize::from(bytes[end] == b'\\');
            }
            end = (end + 1).min(bytes.len());
            found.push(text.get(start..end).unwrap_or("\"\"").to_owned());
            at = end;
        } else if c == b'\'' {
            at += quote(rest);
        } else if c.is_ascii_alphanumeric() || c == b'_' {
            let rest = rest.strip_prefix("r#").unwrap_or(rest);
            at = text.len() - rest.len();
            let length = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            found.push(rest[..length].to_owned());
            at += length;
        } else if rest.starts_with("::") {
            found.push("::".to_owned());
            at += 2;
        } else {
            let length = rest.chars().next().map_or(1, char::len_utf8);
            if !c.is_ascii_whitespace() {
                found.push(rest[..length].to_owned());
            }
            at += length;
        }
    }
    found
}

fn block_comment(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    let bytes = text.as_bytes();
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" => {
                (depth, at) = (depth - 1, at + 2);
                if depth == 0 {
                    return at;
                }
            }
            _ => at += 1,
        }
    }
    bytes.len()
}

/// Length of a raw string that begins here.
fn raw_string(text: &str) -> Option<usize> {
    let start = ["r", "br", "cr"].iter().find_map(|prefix| text.strip_prefix(prefix))?;
    let hashes = start.bytes().take_while(|b| *b == b'#').count();
    let body = start[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    Some(text.len() - body.len() + body.find(&end)? + end.len())
}

/// Length of a character or of the quote of a lifetime.
fn quote(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    match chars.next() {
        Some((_, '\\')) => text[2..].char_indices().skip(1).find(|(_, c)| *c == '\'').map_or(1, |(k, _)| k + 3),
        Some((k, c)) if text[k + c.len_utf8()..].starts_with('\'') => k + c.len_utf8() + 1,
        _ => 1,
    }
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// A path that begins at a token, without generic arguments, and the token after it.
fn path_at(tokens: &[String], mut at: usize) -> (Vec<String>, usize) {
    let mut path = vec![tokens[at].clone()];
    at += 1;
    while at + 1 < tokens.len() && tokens[at] == "::" && is_name(&tokens[at + 1]) {
        path.push(tokens[at + 1].clone());
        at += 2;
    }
    (path, at)
}

fn attribute_end(tokens: &[String], at: usize) -> usize {
    let start = tokens[at..].iter().position(|t| t == "[").map_or(tokens.len(), |k| at + k);
    let mut depth = 0;
    for (k, token) in tokens.iter().enumerate().skip(start) {
        depth += i32::from(token == "[") - i32::from(token == "]");
        if depth == 0 {
            return k + 1;
        }
    }
    tokens.len()
}

/// `#[cfg(test)]`, alone or as one of `all(...)`.
fn is_test_only(attribute: &[String]) -> bool {
    let has = |word: &str| attribute.iter().any(|t| t == word);
    has("cfg") && has("test") && !has("not") && !has("any")
}

/// The token after the item that begins here, its own attributes included.
fn item_end(tokens: &[String], mut at: usize) -> usize {
    while tokens.get(at).is_some_and(|t| t == "#") {
        at = attribute_end(tokens, at);
    }
    let is_use =
        tokens[at..].iter().take(6).find(|t| *t == "use" || *t == "{" || *t == ";").is_some_and(|t| t == "use");
    while at < tokens.len() {
        match tokens[at].as_str() {
            ";" => return at + 1,
            "{" if !is_use => return block_end(tokens, at),
            _ => at += 1,
        }
    }
    at
}

/// The token after the block that begins at or after this one.
fn block_end(tokens: &[String], at: usize) -> usize {
    let mut depth = 0;
    for (k, token) in tokens.iter().enumerate().skip(at) {
        let change = i32::from(token == "{" || token == "(") - i32::from(token == "}" || token == ")");
        depth += change;
        if depth == 0 && change != 0 {
            return k + 1;
        }
    }
    tokens.len()
}

fn module_file(file: &Path, folder: &Path, name: &str, explicit: Option<&str>) -> PathBuf {
    if let Some(path) = explicit {
        return file.parent().unwrap_or(Path::new("")).join(path);
    }
    let flat = folder.join(format!("{name}.rs"));
    if flat.is_file() { flat } else { folder.join(name).join("mod.rs") }
}

/// The names of a `use` declaration, without the word and the semicolon.
fn use_tree(tokens: &[String], prefix: &[String], public: bool, uses: &mut Vec<Use>) {
    let mut path = prefix.to_vec();
    let mut at = 0;
    while at < tokens.len() {
        match tokens[at].as_str() {
            "::" => {}
            "{" => {
                let end = block_end(tokens, at) - 1;
                for branch in split_branches(&tokens[at + 1..end]) {
                    use_tree(branch, &path, public, uses);
                }
                return;
            }
            "*" => {
                uses.push(Use { path, alias: "*".into(), public });
                return;
            }
            "as" => {
                let alias = tokens.get(at + 1).cloned().unwrap_or_default();
                uses.push(Use { path, alias, public });
                return;
            }
            // `use a::{self}` is `use a`.
            "self" if !path.is_empty() => {}
            name => path.push(name.to_owned()),
        }
        at += 1;
    }
    if let Some(alias) = path.last().cloned() {
        uses.push(Use { path, alias, public });
    }
}

fn split_branches(tokens: &[String]) -> Vec<&[String]> {
    let (mut branches, mut start, mut depth) = (Vec::new(), 0, 0);
    for (k, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            "," if depth == 0 => {
                branches.push(&tokens[start..k]);
                start = k + 1;
            }
            _ => {}
        }
    }
    branches.push(&tokens[start..]);
    branches.retain(|branch| !branch.is_empty());
    branches
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
