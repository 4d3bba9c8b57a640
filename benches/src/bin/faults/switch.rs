//! Faults behind a switch: the block of code around each place is there twice, once with the fault; so is a constant.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

use crate::blocks::Blocks;

/// A fault in one file.
pub(crate) struct Edit<'a> {
    pub(crate) id: usize,
    /// What it is called in the code.
    pub(crate) number: u32,
    pub(crate) place: &'a Range<usize>,
    pub(crate) replacement: &'a str,
    /// How many of the blocks that would do are not to be used.
    pub(crate) skip: usize,
}

/// A file with all its faults.
#[derive(Default)]
pub(crate) struct Switched {
    pub(crate) text: String,
    /// Lines, from 1, that only a fault has.
    pub(crate) lines: Vec<(Range<usize>, usize)>,
    /// Lines of what is there twice, and all its faults.
    pub(crate) regions: Vec<(Range<usize>, Vec<usize>)>,
    /// Faults around which there is no (further) block of code that runs.
    pub(crate) outside: Vec<usize>,
}

/// What stands at a place of the file instead.
enum Change<'a> {
    /// The block with one of the faults, or without.
    Block(Vec<&'a Edit<'a>>),
    /// The constant of one of these faults, by number and index, or that without.
    Use(Vec<(u32, usize)>),
    /// More constants, one a fault.
    Constants(Vec<(usize, String)>),
}

/// Changes by their places; a block comes before what is in it.
type Changes<'a> = BTreeMap<(usize, Reverse<usize>), Change<'a>>;

/// Puts faults into the text of a file; `runtime` is the path of the function that says which one is on.
pub(crate) fn switch(text: &str, edits: &[Edit], runtime: &str) -> syn::Result<Switched> {
    let blocks = Blocks::parse(text)?;
    let mut done = Switched::default();
    let mut changes = Changes::new();
    for edit in edits {
        if let Some(block) = blocks.around(edit.place).nth(edit.skip) {
            let here = changes.entry((block.start, Reverse(block.end))).or_insert(Change::Block(Vec::new()));
            if let Change::Block(edits) = here {
                edits.push(edit);
            }
        } else if let Some(constant) = blocks.constant(edit.place).filter(|_| edit.skip == 0) {
            let (name, item) = (&constant.place_of_name, &constant.item);
            let more = format!(
                "\n#[allow(missing_docs)] {}{}_{}{}{}{}",
                &text[item.start..name.start],
                constant.name,
                edit.number,
                &text[name.end..edit.place.start],
                edit.replacement,
                &text[edit.place.end..item.end]
            );
            let here = changes.entry((item.end, Reverse(item.end))).or_insert(Change::Constants(Vec::new()));
            if let Change::Constants(constants) = here {
                constants.push((edit.id, more));
            }
            for (_, path) in blocks.uses.iter().filter(|(name, _)| *name == constant.name) {
                let here = changes.entry((path.start, Reverse(path.end))).or_insert(Change::Use(Vec::new()));
                if let Change::Use(ids) = here {
                    ids.push((edit.number, edit.id));
                }
            }
        } else {
            done.outside.push(edit.id);
        }
    }
    Writer { text, runtime, changes: &changes, done: &mut done, line: 1 }.original(0..text.len(), None);
    Ok(done)
}

struct Writer<'a> {
    text: &'a str,
    runtime: &'a str,
    changes: &'a Changes<'a>,
    done: &'a mut Switched,
    line: usize,
}

impl Writer<'_> {
    fn push(&mut self, text: &str) {
        self.line += text.matches('\n').count();
        self.done.text.push_str(text);
    }

    /// A part of the file without a fault, but for the switches inside it; `but` is the part itself.
    fn original(&mut self, part: Range<usize>, but: Option<&Range<usize>>) {
        let (text, changes) = (self.text, self.changes);
        let mut at = part.start;
        for (&(start, Reverse(end)), change) in changes.range((part.start, Reverse(usize::MAX))..) {
            // What lies in a block that was written is behind `at`.
            if start < at || end > part.end || but == Some(&(start..end)) {
                continue;
            }
            self.push(&text[at..start]);
            match change {
                Change::Block(edits) => self.block(start..end, edits),
                Change::Use(ids) => self.used(&text[start..end], ids),
                Change::Constants(constants) => {
                    for (id, more) in constants {
                        let first = self.line;
                        self.push(more);
                        self.done.lines.push((first + 1..self.line + 1, *id));
                    }
                }
            }
            at = end;
        }
        self.push(&text[at..part.end]);
    }

    fn block(&mut self, block: Range<usize>, edits: &[&Edit]) {
        let (text, first) = (self.text, self.line);
        self.push("\n");
        for Edit { id, number, place, replacement, .. } in edits {
            let mut head = String::new();
            let _ = writeln!(head, "if {}({number}) {{", self.runtime);
            self.push(&head);
            let start = self.line;
            self.push(&text[block.start..place.start]);
            self.push(replacement);
            self.push(&text[place.end..block.end]);
            self.push("\n");
            self.done.lines.push((start..self.line, *id));
            self.push("} else ");
        }
        self.push("{\n");
        self.original(block.clone(), Some(&block));
        self.push("\n}\n");
        self.done.regions.push((first..self.line, edits.iter().map(|e| e.id).collect()));
    }

    fn used(&mut self, path: &str, faults: &[(u32, usize)]) {
        let each = faults.iter().map(|(n, _)| format!("if {}({n}) {{ {path}_{n} }} else ", self.runtime));
        let chosen = format!("({}{{ {path} }})", each.collect::<String>());
        self.push(&chosen);
        self.done.regions.push((self.line..self.line + 1, faults.iter().map(|(_, id)| *id).collect()));
    }
}
