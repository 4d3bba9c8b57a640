//! What a problem has unless it is told otherwise.

use std::sync::LazyLock;

use super::limits::Limits;
use crate::model::{Saturation, SprayKernel};

pub(crate) static SATURATION: Saturation = Saturation::Tanh;
pub(crate) static LIMITS: Limits = Limits::DEFAULT;
pub(crate) static KERNEL: LazyLock<SprayKernel> = LazyLock::new(SprayKernel::default);
