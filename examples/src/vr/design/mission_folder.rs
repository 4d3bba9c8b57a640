//! Missions that are written into a folder beside what is there.

use std::path::{Path, PathBuf};

use super::design_error::DesignError;
use super::picture_store::StoredPicture;
use crate::mission_file::MissionFile;
use crate::whole_file;

/// Writes a mission with its picture under names that are free; the mission's file.
///
/// # Errors
/// What the system says.
pub(super) fn write_mission(
    mission: &MissionFile,
    picture: &StoredPicture,
    folder: &Path,
) -> Result<PathBuf, DesignError> {
    std::fs::create_dir_all(folder).map_err(DesignError::unwritable(folder))?;
    let bytes = std::fs::read(&picture.path).map_err(DesignError::unwritable(&picture.path))?;
    let own = |file: &Path| std::fs::read(file).is_ok_and(|there| there == bytes);
    // The same picture is not written again.
    let beside = free_name(folder, &picture.name, &own);
    if !own(&beside) {
        whole_file::write(&beside, &bytes).map_err(DesignError::unwritable(&beside))?;
    }
    let path = free_name(folder, "mission.toml", &|_| false);
    MissionFile { design: Some(beside.display().to_string()), ..mission.clone() }.write(&path)?;
    Ok(path)
}

/// The name, or the first of `STEM-2.EXT`, `STEM-3.EXT` and so on, that nothing has or that may be used again.
fn free_name(folder: &Path, name: &str, again: &dyn Fn(&Path) -> bool) -> PathBuf {
    let (stem, ending) = name.rsplit_once('.').unwrap_or((name, ""));
    let numbered = |k: u64| if k == 1 { folder.join(name) } else { folder.join(format!("{stem}-{k}.{ending}")) };
    (1..=u64::from(u32::MAX))
        .map(numbered)
        .find(|path| path.symlink_metadata().is_err() || again(path))
        .unwrap_or_else(|| folder.join(name))
}
