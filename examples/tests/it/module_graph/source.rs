//! What a source file says of its modules, items and imports, parsed by syn.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemUse, Macro, UseTree, Visibility};

/// A module as its source has it.
pub(super) struct Module {
    pub(super) file: PathBuf,
    pub(super) parent: Option<usize>,
    pub(super) children: BTreeMap<String, usize>,
    pub(super) items: BTreeSet<String>,
    pub(super) uses: Vec<Use>,
    /// All paths in the code, single identifiers included, `use` declarations left out.
    pub(super) paths: BTreeSet<Vec<String>>,
}

/// One name that a `use` declaration brings in.
pub(super) struct Use {
    pub(super) path: Vec<String>,
    /// The name it has here; `*` for all names of a module.
    pub(super) alias: String,
    pub(super) public: bool,
}

/// What is read from the items of a module: their `use` declarations and paths, those within functions included.
impl<'ast> Visit<'ast> for Module {
    fn visit_item(&mut self, item: &'ast Item) {
        if !attributes(item).iter().any(is_test_only) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let public = !matches!(item.vis, Visibility::Inherited);
        use_tree(&item.tree, &[], public, &mut self.uses);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        self.paths.insert(path.segments.iter().map(|segment| name(&segment.ident)).collect());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, call: &'ast Macro) {
        self.visit_path(&call.path);
        paths_in(call.tokens.clone(), &mut self.paths);
    }

    /// Neither documentation nor the place in `pub(in ...)` is an import.
    fn visit_attribute(&mut self, _: &'ast Attribute) {}
    fn visit_visibility(&mut self, _: &'ast Visibility) {}
    /// What a macro of our own expands to is not followed.
    fn visit_item_macro(&mut self, item: &'ast syn::ItemMacro) {
        if item.ident.is_none() {
            self.visit_macro(&item.mac);
        }
    }
}

pub(super) fn parse(file: &Path) -> std::io::Result<Vec<Item>> {
    let in_file = |kind, e: &dyn std::fmt::Display| std::io::Error::new(kind, format!("{}: {e}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|e| in_file(e.kind(), &e))?;
    Ok(syn::parse_file(&text).map_err(|e| in_file(std::io::ErrorKind::InvalidData, &e))?.items)
}

/// An identifier without the mark of a raw one.
fn name(identifier: &proc_macro2::Ident) -> String {
    identifier.to_string().trim_start_matches("r#").to_owned()
}

/// The name that an item gives to its module.
pub(super) fn name_of(item: &Item) -> Option<String> {
    let identifier = match item {
        Item::Const(item) => &item.ident,
        Item::Enum(item) => &item.ident,
        Item::Fn(item) => &item.sig.ident,
        Item::Macro(item) => item.ident.as_ref()?,
        Item::Static(item) => &item.ident,
        Item::Struct(item) => &item.ident,
        Item::Trait(item) => &item.ident,
        Item::Type(item) => &item.ident,
        _ => return None,
    };
    Some(name(identifier)).filter(|name| name != "_")
}

pub(super) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(syn::ItemConst { attrs, .. })
        | Item::Enum(syn::ItemEnum { attrs, .. })
        | Item::Fn(syn::ItemFn { attrs, .. })
        | Item::Impl(syn::ItemImpl { attrs, .. })
        | Item::Macro(syn::ItemMacro { attrs, .. })
        | Item::Mod(syn::ItemMod { attrs, .. })
        | Item::Static(syn::ItemStatic { attrs, .. })
        | Item::Struct(syn::ItemStruct { attrs, .. })
        | Item::Trait(syn::ItemTrait { attrs, .. })
        | Item::Type(syn::ItemType { attrs, .. })
        | Item::Use(ItemUse { attrs, .. }) => attrs,
        _ => &[],
    }
}

/// `#[cfg(test)]`, alone or as one of `all(...)`.
pub(super) fn is_test_only(attribute: &Attribute) -> bool {
    let mut words = BTreeSet::new();
    let Ok(condition) = attribute.meta.require_list() else { return false };
    paths_in(condition.tokens.clone(), &mut words);
    let has = |word: &str| words.contains(&vec![word.to_owned()]);
    condition.path.is_ident("cfg") && has("test") && !has("not") && !has("any")
}

/// The paths among tokens that are not parsed, single words included; fields and methods are none.
fn paths_in(tokens: TokenStream, paths: &mut BTreeSet<Vec<String>>) {
    let mut path = Vec::new();
    let mut before = String::new();
    for token in tokens {
        match &token {
            TokenTree::Ident(word) if before == "." => before = name(word),
            TokenTree::Ident(word) => {
                if before != "::" {
                    paths.extend(Some(std::mem::take(&mut path)).filter(|path: &Vec<String>| !path.is_empty()));
                }
                path.push(name(word));
                before = "word".into();
            }
            TokenTree::Punct(sign) if sign.as_char() == ':' && before == ":" => before = "::".into(),
            TokenTree::Punct(sign) => before = sign.to_string(),
            TokenTree::Group(group) => {
                paths_in(group.stream(), paths);
                before.clear();
            }
            TokenTree::Literal(_) => before.clear(),
        }
    }
    paths.extend(Some(path).filter(|path| !path.is_empty()));
}

pub(super) fn module_file(file: &Path, folder: &Path, name: &str, attributes: &[Attribute]) -> PathBuf {
    let explicit = attributes.iter().find_map(|attribute| match &attribute.meta.require_name_value().ok()?.value {
        syn::Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(path), .. }) if attribute.path().is_ident("path") => {
            Some(path.value())
        }
        _ => None,
    });
    if let Some(path) = explicit {
        return file.parent().unwrap_or(Path::new("")).join(path);
    }
    let flat = folder.join(format!("{name}.rs"));
    if flat.is_file() { flat } else { folder.join(name).join("mod.rs") }
}

/// The names that a `use` declaration brings in.
fn use_tree(tree: &UseTree, prefix: &[String], public: bool, uses: &mut Vec<Use>) {
    // `use a::{self}` is `use a`.
    let below = |last: String| {
        let last = Some(last).filter(|last| last != "self" || prefix.is_empty());
        prefix.iter().cloned().chain(last).collect::<Vec<_>>()
    };
    match tree {
        UseTree::Path(step) => use_tree(&step.tree, &below(name(&step.ident)), public, uses),
        UseTree::Group(group) => group.items.iter().for_each(|branch| use_tree(branch, prefix, public, uses)),
        UseTree::Glob(_) => uses.push(Use { path: prefix.to_vec(), alias: "*".into(), public }),
        UseTree::Rename(new) => {
            uses.push(Use { path: below(name(&new.ident)), alias: name(&new.rename), public });
        }
        UseTree::Name(leaf) => {
            let path = below(name(&leaf.ident));
            uses.extend(path.last().cloned().map(|alias| Use { path, alias, public }));
        }
    }
}
