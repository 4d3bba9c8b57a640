//! `unwrap`: a mesh becomes charts on pages, written as files that other programs open.

mod arguments;
mod error;
mod files;
mod page_picture;
mod previous;
mod report;
mod run;

pub use arguments::Arguments;
pub use error::UnwrapError;
pub use report::UnwrapReport;
pub use run::run;
