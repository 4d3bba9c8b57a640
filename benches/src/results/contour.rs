//! A contour that a simulated hand treats, and the robot (VR letter, Section VI-A, its Fig. 5; thesis, Fig. 7.5).

use std::error::Error;
use std::path::Path;

use clap::Parser as _;
use paintcopter::vr::{Arguments, run};

use super::program_report::ProgramReport;
use super::table::{Table, number};

/// The table.
///
/// # Errors
/// Those of `vr`, and a report without what is shown.
pub fn tables(scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let folder = scratch.join("contour");
    let out = format!("--out={}", folder.display());
    run(&Arguments::try_parse_from(["vr", "--experiment=contour", &out])?)?;
    let report = ProgramReport::read(&folder.join("contour"))?;
    let figure = |name: &str| report.figure(name);
    let mut table = Table::new("contour", &["figure", "letter", "asked", "here"]);
    let length = number(figure("contour_length_m")?, 2);
    table.row(["length of the contour; m".into(), "-".into(), "-".into(), length]);
    let treated = number(100.0 * figure("treated_share")?, 1);
    table.row(["treated; %".into(), "no trace is left".into(), "99".into(), treated]);
    let beside = number(100.0 * figure("overspray_share")?, 1);
    table.row(["paint farther than 3 cm from it; %".into(), "-".into(), "15".into(), beside]);
    Ok(vec![table])
}
