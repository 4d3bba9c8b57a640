//! What became of faults: by name, and counted by crate.

use std::collections::BTreeMap;
use std::fmt;

use crate::fault::{Fault, Origin};

/// What became of a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// This test fails or hangs with it.
    Seen(String),
    /// So many tests reach it, and all pass.
    Missed(usize),
    /// It is no program.
    DoesNotCompile,
    /// It is in no block that runs: a constant, a signature, a shader.
    NotSwitched,
    /// It could not be tried.
    Broken(String),
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seen(test) => write!(f, "seen by {test}"),
            Self::Missed(0) => write!(f, "MISSED, no test reaches it"),
            Self::Missed(reaching) => write!(f, "MISSED by {reaching} tests that reach it"),
            Self::DoesNotCompile => write!(f, "does not compile"),
            Self::NotSwitched => write!(f, "cannot be switched"),
            Self::Broken(why) => write!(f, "not tried: {why}"),
        }
    }
}

/// Faults of one crate.
#[derive(Default, Clone, Copy)]
struct Row {
    /// By hand and by a program: seen, missed.
    counts: [[usize; 2]; 2],
    harmless: usize,
    not_compiled: usize,
    not_switched: usize,
}

impl Row {
    fn add(&mut self, fault: &Fault, outcome: &Outcome) {
        let origin = fault.origin;
        match outcome {
            Outcome::Seen(_) => self.counts[origin as usize][0] += 1,
            Outcome::Missed(_) if fault.harmless.is_some() => self.harmless += 1,
            Outcome::Missed(_) | Outcome::Broken(_) => self.counts[origin as usize][1] += 1,
            Outcome::DoesNotCompile => self.not_compiled += 1,
            Outcome::NotSwitched => self.not_switched += 1,
        }
    }

    fn share(&self, origin: Origin) -> f64 {
        let [seen, missed] = self.counts[origin as usize];
        seen as f64 / (seen + missed).max(1) as f64
    }

    fn print(&self, name: &str) {
        let cell = |origin: Origin| {
            let [seen, missed] = self.counts[origin as usize];
            format!("{seen} of {} | {:.0} %", seen + missed, 100.0 * self.share(origin))
        };
        let (hand, mutants) = (cell(Origin::Hand), cell(Origin::Mutant));
        println!("| {name} | {hand} | {mutants} | {} | {} | {} |", self.harmless, self.not_compiled, self.not_switched);
    }
}

/// Prints all that is missed and the table; whether enough is seen.
pub(crate) fn print(faults: &[Fault], outcomes: &[(usize, Outcome)]) -> bool {
    let (mut rows, mut sum) = (BTreeMap::<&str, Row>::new(), Row::default());
    for (id, outcome) in outcomes {
        let fault = &faults[*id];
        if !matches!(outcome, Outcome::Seen(_)) {
            let why = fault.harmless.as_ref().map_or(String::new(), |why| format!("; harmless: {why}"));
            println!("{}: {outcome}{why}", fault.title());
        }
        rows.entry(&fault.krate).or_default().add(fault, outcome);
        sum.add(fault, outcome);
    }
    println!("\n| crate | by hand: seen | | mutants: seen | | change nothing | do not compile | cannot be switched |");
    println!("|---|---|---|---|---|---|---|---|");
    for (name, row) in &rows {
        row.print(name);
    }
    sum.print("all");
    let enough = |origin: Origin, share: f64| sum.counts[origin as usize] == [0, 0] || sum.share(origin) >= share;
    enough(Origin::Hand, 0.95) && enough(Origin::Mutant, 0.9)
}
