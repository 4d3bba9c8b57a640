//! A tree of visual words: descriptors that are near each other fall into one (Nistér and Stewénius 2006; of binary descriptors
//! Gálvez-López and Tardós 2012).

use std::sync::{Arc, OnceLock};

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::SeedableRng;

use crate::error::Error;
use crate::file::byte_reader::ByteReader;
use crate::place_recognition::clustering::clustered;
use crate::place_recognition::descriptor::Descriptor;

const MAGIC: &[u8; 8] = b"VOCABUL1";
/// Levels below the root, of eight children each: 4096 words at most.
const LEVELS: usize = 4;

/// What comes with the crate, trained on rendered rooms by `library_figures vocabulary`.
static SHIPPED: &[u8] = include_bytes!("vocabulary.bin");

/// A tree of visual words: what a [`KeyframeIndex`](crate::place_recognition::KeyframeIndex) finds places again by.
///
/// The one that comes with the crate was trained on rendered rooms. For pictures of another kind another one can be trained on the
/// keyframes of a map: [`KeyframeIndex::train_vocabulary`](crate::place_recognition::KeyframeIndex::train_vocabulary).
#[derive(Clone, Debug, PartialEq)]
pub struct Vocabulary {
    /// The root is the first; children lie side by side, after all nodes of the levels above.
    nodes: Vec<Node>,
    words: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    centre: Descriptor,
    first_child: u32,
    /// None: a word.
    children: u32,
    /// Number of the word, of a word.
    word: u32,
}

impl Vocabulary {
    /// The one that comes with the crate.
    pub fn shipped() -> Arc<Self> {
        static READ: OnceLock<Arc<Vocabulary>> = OnceLock::new();
        // A test reads it. Without words nothing is recognised, and small images go on working.
        let read = || Arc::new(Self::from_bytes(SHIPPED).unwrap_or(Self { nodes: Vec::new(), words: 0 }));
        READ.get_or_init(read).clone()
    }

    /// Number of words.
    pub fn words(&self) -> usize {
        self.words
    }

    /// The word of a descriptor: from the root to the nearest child, and so on.
    pub(crate) fn word(&self, descriptor: &Descriptor) -> Option<u32> {
        let mut node = self.nodes.first()?;
        while node.children > 0 {
            let children = &self.nodes[node.first_child as usize..][..node.children as usize];
            node = children.iter().min_by_key(|child| child.centre.distance(descriptor))?;
        }
        Some(node.word)
    }

    /// Clusters descriptors into at most 4096 words: k-medians of eight clusters, four levels deep.
    pub(crate) fn train(descriptors: &[Descriptor], seed: u64) -> Self {
        let mut random = SplitMix64::seed_from_u64(seed);
        let root = Node { centre: Descriptor::default(), first_child: 0, children: 0, word: 0 };
        let mut nodes = vec![root];
        let mut level: Vec<(usize, Vec<Descriptor>)> = vec![(0, descriptors.to_vec())];
        for _ in 0..LEVELS {
            let mut next = Vec::new();
            for (parent, members) in level {
                let clusters = clustered(members, &mut random);
                if clusters.len() < 2 {
                    continue;
                }
                (nodes[parent].first_child, nodes[parent].children) = (nodes.len() as u32, clusters.len() as u32);
                for (centre, members) in clusters {
                    next.push((nodes.len(), members));
                    nodes.push(Node { centre, first_child: 0, children: 0, word: 0 });
                }
            }
            level = next;
        }
        Self::numbered(nodes)
    }

    /// Numbers the words.
    fn numbered(mut nodes: Vec<Node>) -> Self {
        let mut words = 0;
        for node in nodes.iter_mut().filter(|node| node.children == 0) {
            node.word = words;
            words += 1;
        }
        Self { nodes, words: words as usize }
    }

    /// For [`from_bytes`](Self::from_bytes).
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        out.extend_from_slice(&(self.nodes.len() as u32).to_le_bytes());
        for node in &self.nodes {
            out.extend_from_slice(&node.children.to_le_bytes());
            node.centre.0.iter().for_each(|word| out.extend_from_slice(&word.to_le_bytes()));
        }
        out
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// [`Error::CorruptFile`], with the byte.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        let mut input = ByteReader::new(bytes, 0, "the vocabulary");
        if input.array()? != *MAGIC {
            return Err(input.bad());
        }
        let count = input.u32()?;
        let mut nodes = Vec::new();
        // Children lie in the order of their parents.
        let mut first_child = 1;
        for at in 0..count {
            let children = input.u32()?;
            let mut centre = Descriptor::default();
            for word in &mut centre.0 {
                *word = input.u64()?;
            }
            if children > 0 && (first_child <= at || children > count - first_child.min(count)) {
                return Err(input.bad());
            }
            let first = if children > 0 { first_child } else { 0 };
            nodes.push(Node { centre, first_child: first, children, word: 0 });
            first_child += children;
        }
        input.end()?;
        if count == 0 || first_child != count {
            return Err(input.bad());
        }
        Ok(Self::numbered(nodes))
    }
}

#[cfg(test)]
mod tests {
    use rand_xoshiro::rand_core::Rng;

    use super::*;

    /// Sixty groups of descriptors, too small to be clustered again; those of a group differ in few bits.
    fn grouped() -> Vec<(usize, Descriptor)> {
        let mut random = SplitMix64::seed_from_u64(3);
        let mut out = Vec::new();
        for group in 0..60 {
            let centre = Descriptor(std::array::from_fn(|_| random.next_u64()));
            for _ in 0..14 {
                let mut member = centre;
                (0..6).for_each(|_| member.0[(random.next_u64() % 4) as usize] ^= 1 << (random.next_u64() % 64));
                out.push((group, member));
            }
        }
        out
    }

    #[test]
    fn a_group_is_a_word() {
        let groups = grouped();
        let descriptors: Vec<Descriptor> = groups.iter().map(|(_, d)| *d).collect();
        let vocabulary = Vocabulary::train(&descriptors, 1);
        let words: Vec<Vec<u32>> = (0..60)
            .map(|group| {
                let own = groups.iter().filter(|(g, _)| *g == group);
                let mut words: Vec<u32> = own.filter_map(|(_, d)| vocabulary.word(d)).collect();
                words.sort_unstable();
                words.dedup();
                words
            })
            .collect();
        let whole = words.iter().filter(|words| words.len() == 1).count();
        // Groups at random lie equally far from all medians: some fall between two.
        assert!(whole >= 35, "{whole} of 60 groups fall into one word");
        let mut of_whole: Vec<u32> = words.iter().filter(|w| w.len() == 1).map(|w| w[0]).collect();
        of_whole.sort_unstable();
        of_whole.dedup();
        assert!(of_whole.len() + 4 >= whole, "{} words for {whole} groups", of_whole.len());
        assert_eq!(Vocabulary::train(&descriptors, 1), vocabulary, "the same seed, the same words");
        assert!(Vocabulary::train(&[], 1).word(&Descriptor::default()).is_some(), "one word for all");
    }

    #[test]
    fn the_shipped_words_are_read_and_damage_is_named() {
        assert!(Vocabulary::shipped().words() > 3000);
        let descriptors: Vec<Descriptor> = grouped().into_iter().map(|(_, d)| d).collect();
        let vocabulary = Vocabulary::train(&descriptors, 2);
        let bytes = vocabulary.to_bytes();
        assert!(Vocabulary::from_bytes(&bytes).unwrap() == vocabulary);
        for length in 0..bytes.len() {
            assert!(Vocabulary::from_bytes(&bytes[..length]).is_err(), "{length}");
        }
        // Children that would be their own ancestors, or beyond the end.
        for children in [0_u32, 1, 200, u32::MAX] {
            let mut damaged = bytes.clone();
            damaged[12..16].copy_from_slice(&children.to_le_bytes());
            assert!(Vocabulary::from_bytes(&damaged).is_err(), "{children}");
        }
    }
}
