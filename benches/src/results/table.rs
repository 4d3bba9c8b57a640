//! A table as data (CSV) and as the book shows it (Markdown): the second is a function of the first.

use std::error::Error;
use std::fmt::Write as _;

/// Cells as they are printed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Name of its file.
    pub name: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows as long as the head.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new(name: &str, head: &[&str]) -> Self {
        Self { name: name.into(), head: head.iter().map(ToString::to_string).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.into());
    }

    /// Its rows with commas between the cells, the head first.
    ///
    /// # Errors
    /// Rows of another length than the head, and cells with a comma, a bar or a line break, which neither form has a place for.
    pub fn csv(&self) -> Result<String, Box<dyn Error>> {
        let mut text = String::new();
        for row in std::iter::once(&self.head).chain(&self.rows) {
            if row.len() != self.head.len() || row.iter().any(|cell| cell.contains([',', '|', '\n'])) {
                return Err(format!("{}: the row {row:?} is no row of this table", self.name).into());
            }
            writeln!(text, "{}", row.join(","))?;
        }
        Ok(text)
    }
}

/// The page's piece for the text of a table, with the command that makes both.
pub fn markdown(name: &str, part: &str, csv: &str) -> String {
    let mut text = format!(
        "<!-- Generated from {name}.csv. Both are written by:\n     \
         cargo run --release -p paintcopter-benches --bin results -- --only {part} -->\n\n"
    );
    for (k, line) in csv.lines().enumerate() {
        let cells = line.split(',');
        let _ = writeln!(text, "| {} |", cells.clone().collect::<Vec<_>>().join(" | "));
        if k == 0 {
            text += &"|---".repeat(cells.count());
            text += "|\n";
        }
    }
    text
}

/// A number with so many digits after the point.
pub(super) fn number(value: f64, digits: usize) -> String {
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_becomes_markdown_by_way_of_its_data() {
        let mut table = Table::new("heights", &["what", "m"]);
        table.row(["wall".into(), number(2.0, 1)]);
        let csv = table.csv().unwrap();
        assert_eq!(csv, "what,m\nwall,2.0\n");
        let page = markdown("heights", "walls", &csv);
        assert!(page.ends_with("-->\n\n| what | m |\n|---|---|\n| wall | 2.0 |\n"), "{page}");
        assert!(page.contains("--only walls "));
        for cells in [["a,b".to_string(), String::new()], ["a|b".into(), String::new()]] {
            let mut broken = table.clone();
            broken.row(cells);
            assert!(broken.csv().is_err());
        }
    }
}
