//! Frames that do not move against each other.

use std::collections::BTreeMap;

use vio_ekf::nalgebra::Isometry3;

/// Frames in a chain at most.
const DEEPEST: usize = 64;

/// The parent of each frame, and its pose there as it was first said.
#[derive(Default)]
pub(super) struct StillFrames(BTreeMap<String, (String, Isometry3<f64>)>);

impl StillFrames {
    pub(super) fn add(&mut self, parent: &str, child: &str, parent_from_child: Isometry3<f64>) {
        self.0.entry(child.to_owned()).or_insert_with(|| (parent.to_owned(), parent_from_child));
    }

    /// `to_from_frame`, if both hang on one frame.
    pub(super) fn pose(&self, frame: &str, to: &str) -> Option<Isometry3<f64>> {
        let (from, to) = (self.chain(frame), self.chain(to));
        let shared = |(name, a): &(&str, Isometry3<f64>)| {
            to.iter()
                .find(|(other, _)| other == name)
                .map(|(_, b)| if b == a { Isometry3::identity() } else { b.inverse() * a })
        };
        from.iter().find_map(shared)
    }

    /// A frame and those that it hangs on, with its pose in each.
    fn chain<'a>(&'a self, frame: &'a str) -> Vec<(&'a str, Isometry3<f64>)> {
        let mut links = vec![(frame, Isometry3::identity())];
        while let Some((parent, pose)) = self.0.get(links[links.len() - 1].0).filter(|_| links.len() < DEEPEST) {
            let so_far = links[links.len() - 1].1;
            links.push((parent, if links.len() == 1 { *pose } else { pose * so_far }));
        }
        links
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_one_tree_are_related_over_what_they_share() {
        let mut frames = StillFrames::default();
        let along = |x: f64| Isometry3::translation(x, 0.0, 0.0);
        frames.add("base", "camera_link", along(1.0));
        frames.add("camera_link", "optical", along(0.25));
        frames.add("base", "imu", along(-2.0));
        frames.add("other", "lonely", along(0.0));
        assert_eq!(frames.pose("optical", "imu").unwrap().translation.x, 3.25);
        assert_eq!(frames.pose("imu", "optical").unwrap().translation.x, -3.25);
        assert_eq!(frames.pose("optical", "camera_link"), Some(along(0.25)));
        assert_eq!(frames.pose("optical", "optical"), Some(Isometry3::identity()));
        assert_eq!(frames.pose("optical", "lonely"), None);
        // A circle ends.
        frames.add("imu", "base", along(0.0));
        assert!(frames.pose("optical", "lonely").is_none());
    }
}
