//! The peers that install as packages, beside ours in one run.

use std::error::Error;
use std::path::Path;
use std::process::Command;

use super::extent::Extent;
use super::table::Table;

/// The rows that `side_by_side.py` finds; none in a quick rerun, which needs nothing but Rust.
///
/// # Errors
/// Python without the packages of `benches/peers/requirements.txt`, or a peer that fails: what it says stands above.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    if extent == Extent::Quick {
        println!("peers: left out, since they need the packages of benches/peers/requirements.txt");
        return Ok(Vec::new());
    }
    std::fs::create_dir_all(scratch)?;
    let file = scratch.join("peers.csv");
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/side_by_side.py");
    let done = Command::new(python).arg(script).arg("--out").arg(&file).status()?;
    if !done.success() {
        return Err(
            "side_by_side.py failed: install benches/peers/requirements.txt, and name that Python by PYTHON".into()
        );
    }
    Ok(vec![read(&std::fs::read_to_string(&file)?)])
}

fn read(csv: &str) -> Table {
    let mut lines = csv.lines().map(|line| line.split(','));
    let head: Vec<&str> = lines.next().into_iter().flatten().collect();
    let mut table = Table::new("peers", &head);
    table.rows.extend(lines.map(|line| line.map(String::from).collect()));
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_that_of_the_script() {
        let csv = "what,peer\nfusion,open3d 0.19\n";
        assert_eq!(read(csv).csv().unwrap(), csv);
        assert!(read("what,peer\nfusion\n").csv().is_err());
    }
}
