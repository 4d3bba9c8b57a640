//! The job of `paint-image`: a picture in, sprays and figures out.

mod arguments;
mod colour;
mod commands;
mod compare;
mod cpu_timer;
mod equal_sprays;
mod error;
mod files;
mod ink;
mod job;
mod progress_sheet;
mod run;
mod training;

pub use arguments::Arguments;
pub use colour::{ColourFigures, Glazes, compare_colours, paint_colours, read_picture, save_colours};
pub use commands::NOZZLE_SPEED;
pub use compare::{Row, compare, table};
pub use equal_sprays::{EqualSprays, equal_sprays, print_equal_sprays, texture_picture};
pub use error::PaintImageError;
pub use files::pictures_in;
pub use ink::read_ink;
pub use job::{Figures, Job, PainterKind};
pub use run::run;
pub use training::{ThesisTrainingRun, TrainingImages, TrainingRun, held_out_patch, train_painter, train_thesis};
