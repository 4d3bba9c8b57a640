//! Which keyframes have a word, and how alike two frames are by their words.

use crate::place_recognition::features::Feature;
use crate::place_recognition::vocabulary::Vocabulary;

/// How often each word occurs in a frame, by word.
pub(crate) type Words = Vec<(u32, u32)>;

/// The words of some features.
pub(crate) fn words(vocabulary: &Vocabulary, features: &[Feature]) -> Words {
    let mut found: Vec<u32> = features.iter().filter_map(|f| vocabulary.word(&f.descriptor)).collect();
    found.sort_unstable();
    found.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u32)).collect()
}

/// For each word the frames that have it, and how often.
#[derive(Clone, Debug, Default)]
pub(crate) struct InverseIndex {
    postings: Vec<Vec<(u32, u32)>>,
    /// Words of each frame, as often as they occur.
    sizes: Vec<f32>,
}

impl InverseIndex {
    /// Takes the next frame.
    pub(crate) fn push(&mut self, words: &Words) {
        let most = words.last().map_or(0, |(word, _)| *word as usize + 1);
        self.postings.resize(most.max(self.postings.len()), Vec::new());
        for (word, count) in words {
            self.postings[*word as usize].push((self.sizes.len() as u32, *count));
        }
        self.sizes.push(size(words));
    }

    /// The frames with the most words in common, the likest first: at most `count` of those that are `wanted`.
    ///
    /// A word counts by the smaller of its shares in both, times the logarithm of how rare it is (inverse document frequency): the L1 score of
    /// Nistér and Stewénius 2006, by which a frame with many features is no likelier than one with few.
    pub(crate) fn query(&self, words: &Words, count: usize, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
        let frames = self.sizes.len();
        let mut scores = vec![0.0_f32; frames];
        let own = size(words);
        for (word, often) in words {
            let Some(postings) = self.postings.get(*word as usize).filter(|p| !p.is_empty()) else { continue };
            let rarity = (1.0 + frames as f32 / postings.len() as f32).ln();
            for (frame, there) in postings {
                let frame = *frame as usize;
                scores[frame] += rarity * (*often as f32 / own).min(*there as f32 / self.sizes[frame]);
            }
        }
        let mut ranked: Vec<usize> = (0..frames).filter(|k| scores[*k] > 0.0 && wanted(*k)).collect();
        ranked.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b)));
        ranked.truncate(count);
        ranked
    }
}

fn size(words: &Words) -> f32 {
    words.iter().map(|(_, often)| *often as f32).sum()
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::SplitMix64;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    use super::*;

    /// Against the sum over all pairs of words.
    #[test]
    fn the_likest_frames_come_first() {
        let mut random = SplitMix64::seed_from_u64(5);
        let mut draw = || {
            let mut words: Words = Vec::new();
            for word in 0..200 {
                if random.next_u64().is_multiple_of(4) {
                    words.push((word, 1 + (random.next_u64() % 3) as u32));
                }
            }
            words
        };
        let frames: Vec<Words> = (0..40).map(|_| draw()).collect();
        let mut index = InverseIndex::default();
        for words in &frames {
            index.push(words);
        }
        let asked = draw();
        let share = |often: u32, words: &Words| f64::from(often) / f64::from(words.iter().map(|w| w.1).sum::<u32>());
        let score = |words: &Words| -> f64 {
            let both = |(word, often): &(u32, u32)| {
                let there = words.iter().find(|(w, _)| w == word)?.1;
                let having = frames.iter().filter(|f| f.iter().any(|(w, _)| w == word)).count();
                Some((1.0 + 40.0 / having as f64).ln() * share(there, words).min(share(*often, &asked)))
            };
            asked.iter().filter_map(both).sum()
        };
        let found = index.query(&asked, 10, |k| k != 7);
        assert_eq!(found.len(), 10);
        assert!(!found.contains(&7));
        let scores: Vec<f64> = found.iter().map(|k| score(&frames[*k])).collect();
        assert!(scores.is_sorted_by(|a, b| *a >= b - 1e-6), "{scores:?}");
        let better = (0..40).filter(|k| *k != 7 && !found.contains(k) && score(&frames[*k]) > scores[9] + 1e-6).count();
        assert_eq!(better, 0);
        assert_eq!(index.query(&frames[3], 1, |_| true), [3]);
        assert!(index.query(&vec![(100_000, 2)], 3, |_| true).is_empty(), "a word that nobody has");
    }
}
