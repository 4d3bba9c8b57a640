//! The tables and curves of the papers beside ours, as the book shows them: reruns, data, and pages made of the data.

pub mod ablations;
pub mod baselines;
pub mod contour;
pub mod digits;
pub mod drift;
mod excerpt;
mod extent;
pub mod handheld;
pub mod latency;
pub mod layers;
pub mod meshes;
pub mod overdose;
pub mod papers;
pub mod peers;
pub mod planners;
mod program_report;
pub mod table;
pub mod thesis_network;
pub mod time_allocation;
pub mod wall;

use std::error::Error;
use std::path::Path;

pub use extent::Extent;
use table::Table;

/// A rerun.
pub type Rerun = fn(Extent, &Path) -> Result<Vec<Table>, Box<dyn Error>>;

/// Reruns in the order of the papers, each with its name; what it needs on the way lies in the folder that it is given. Its first table is
/// shown as such, the others are drawn by `docs/plots/plots.py`.
pub const PARTS: [(&str, Rerun); 16] = [
    ("papers", |_, _| Ok(vec![papers::table()])),
    ("drift", |extent, _| drift::tables(extent)),
    ("flown_baselines", |extent, _| baselines::tables(extent)),
    ("paper_ii_ablations", |_, _| ablations::tables()),
    ("planners", |extent, _| planners::tables(extent)),
    ("time_allocation", |_, _| time_allocation::tables()),
    ("contour", |_, scratch| contour::tables(scratch)),
    ("latency", latency::tables),
    ("layers", layers::tables),
    ("digits", digits::tables),
    ("thesis_network", |extent, _| thesis_network::tables(extent)),
    ("wall", |extent, _| wall::tables(extent)),
    ("meshes", meshes::tables),
    ("handheld", handheld::tables),
    ("overdose", overdose::tables),
    ("peers", peers::tables),
];

/// Writes what a part found: the data of all tables, and the page's piece of the first.
///
/// # Errors
/// Tables that are none, and files that cannot be written.
pub fn write(part: &str, tables: &[Table], folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    for (k, table) in tables.iter().enumerate() {
        let csv = table.csv()?;
        std::fs::write(folder.join(format!("{}.csv", table.name)), &csv)?;
        if k == 0 {
            let page = table::markdown(&table.name, part, &csv);
            std::fs::write(folder.join(format!("{}.md", table.name)), page)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// FNV-1a, as `plots.py` notes it in each plot.
    fn digest(bytes: &[u8]) -> String {
        let value = bytes
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |value, byte| (value ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3));
        format!("fnv1a:{value:016x}")
    }

    /// A plot carries the digest of the table that it was drawn from.
    #[test]
    fn the_plots_show_the_committed_data() {
        assert_eq!(digest(b"a"), "fnv1a:af63dc4c8601ec8c");
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/generated");
        let plots = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
        let plots: Vec<_> = plots.filter(|path| path.extension().is_some_and(|ending| ending == "svg")).collect();
        assert!(plots.len() >= 5, "{plots:?}");
        for plot in plots {
            let of = digest(&std::fs::read(plot.with_extension("csv")).unwrap());
            assert!(std::fs::read_to_string(&plot).unwrap().contains(&of), "{}: run plots.py", plot.display());
        }
    }

    /// What the table of the papers links to is there: the page, and the heading.
    #[test]
    fn the_places_of_the_papers_parts_exist() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src");
        let table = papers::table();
        let links: Vec<&str> =
            table.rows.iter().filter_map(|row| Some(row[2].split_once("](")?.1.split_once(')')?.0)).collect();
        assert!(links.len() > 15, "{links:?}");
        for link in links {
            let (page, heading) = link.split_once('#').unwrap_or((link, ""));
            let text = std::fs::read_to_string(source.join(page)).unwrap();
            let anchor = |line: &str| {
                let kept = |c: &char| c.is_alphanumeric() || [' ', '-'].contains(c);
                line.trim_start_matches('#')
                    .trim()
                    .to_lowercase()
                    .chars()
                    .filter(kept)
                    .collect::<String>()
                    .replace(' ', "-")
            };
            let found = text.lines().filter(|line| line.starts_with('#')).any(|line| anchor(line) == heading);
            assert!(heading.is_empty() || found, "{link}");
        }
    }

    /// Nobody has written into the generated pieces by hand, and the book shows every one of them.
    #[test]
    fn the_books_pieces_are_what_their_data_says() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src");
        let results = std::fs::read_to_string(source.join("results.md")).unwrap();
        for (part, _) in PARTS {
            let read = |ending| std::fs::read_to_string(source.join(format!("generated/{part}.{ending}"))).unwrap();
            assert_eq!(read("md"), table::markdown(part, part, &read("csv")), "{part}");
            assert!(results.contains(&format!("{{{{#include generated/{part}.md}}}}")), "results.md lacks {part}");
        }
    }
}
