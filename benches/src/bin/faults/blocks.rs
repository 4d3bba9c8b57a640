//! What of a file runs, and can be there twice: blocks of code, and constants with their uses.

use std::ops::Range;

use proc_macro2::Span;
use syn::visit::{self, Visit};

/// The blocks and constants of a file, in bytes.
#[derive(Default)]
pub(crate) struct Blocks {
    /// What runs between braces, without them; whether it is the body of a function.
    code: Vec<(Range<usize>, bool)>,
    pub(crate) constants: Vec<Constant>,
    /// Names that end a path in code that runs, and the whole paths.
    pub(crate) uses: Vec<(String, Range<usize>)>,
    of_function: bool,
}

/// A constant of a module or a type.
pub(crate) struct Constant {
    pub(crate) name: String,
    pub(crate) place_of_name: Range<usize>,
    /// With its visibility, without its attributes.
    pub(crate) item: Range<usize>,
    value: Range<usize>,
}

impl Blocks {
    pub(crate) fn parse(text: &str) -> syn::Result<Self> {
        let mut blocks = Self::default();
        blocks.visit_file(&syn::parse_file(text)?);
        Ok(blocks)
    }

    /// The innermost block around a place, then that of the function.
    pub(crate) fn around(&self, place: &Range<usize>) -> impl Iterator<Item = &Range<usize>> {
        let around = || self.code.iter().filter(|(b, _)| b.start <= place.start && place.end <= b.end);
        let innermost = around().min_by_key(|(b, _)| b.len()).map(|(b, _)| b);
        let body = around().filter(|(_, of_function)| *of_function).min_by_key(|(b, _)| b.len()).map(|(b, _)| b);
        innermost.into_iter().chain(body.filter(|b| Some(*b) != innermost))
    }

    /// The constant whose value a place is in, if code of this file uses it.
    pub(crate) fn constant(&self, place: &Range<usize>) -> Option<&Constant> {
        let within = |c: &&Constant| c.value.start <= place.start && place.end <= c.value.end;
        self.constants.iter().find(within).filter(|c| self.uses.iter().any(|(name, _)| *name == c.name))
    }

    fn function(&mut self, signature: &syn::Signature, block: Option<&syn::Block>) {
        // What is known when the code is compiled cannot be switched.
        if let (None, Some(block)) = (&signature.constness, block) {
            self.of_function = true;
            self.visit_block(block);
        }
    }

    fn constant_item(&mut self, visibility: &syn::Visibility, name: &syn::Ident, [head, equals, end]: [Span; 3]) {
        let head = match visibility {
            syn::Visibility::Public(public) => public.span,
            syn::Visibility::Restricted(restricted) => restricted.pub_token.span,
            syn::Visibility::Inherited => head,
        };
        self.constants.push(Constant {
            name: name.to_string(),
            place_of_name: name.span().byte_range(),
            item: head.byte_range().start..end.byte_range().end,
            value: equals.byte_range().end..end.byte_range().start,
        });
    }
}

impl<'ast> Visit<'ast> for Blocks {
    fn visit_block(&mut self, block: &'ast syn::Block) {
        let of_function = std::mem::take(&mut self.of_function);
        let braces = block.brace_token.span;
        self.code.push((braces.open().byte_range().end..braces.close().byte_range().start, of_function));
        visit::visit_block(self, block);
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.sig, Some(&item.block));
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.function(&item.sig, Some(&item.block));
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        self.function(&item.sig, item.default.as_ref());
    }

    fn visit_item_const(&mut self, item: &'ast syn::ItemConst) {
        let tokens = [item.const_token.span, item.eq_token.span, item.semi_token.span];
        self.constant_item(&item.vis, &item.ident, tokens);
    }

    fn visit_impl_item_const(&mut self, item: &'ast syn::ImplItemConst) {
        let tokens = [item.const_token.span, item.eq_token.span, item.semi_token.span];
        self.constant_item(&item.vis, &item.ident, tokens);
    }

    fn visit_expr_path(&mut self, path: &'ast syn::ExprPath) {
        let segments = &path.path.segments;
        if let (None, None, Some(first), Some(last)) =
            (&path.qself, &path.path.leading_colon, segments.first(), segments.last())
        {
            let place = first.ident.span().byte_range().start..last.ident.span().byte_range().end;
            self.uses.push((last.ident.to_string(), place));
        }
    }

    fn visit_expr_repeat(&mut self, repeat: &'ast syn::ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_pat(&mut self, _: &'ast syn::Pat) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
    fn visit_type(&mut self, _: &'ast syn::Type) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
    fn visit_variant(&mut self, _: &'ast syn::Variant) {}
}
