//! Values by block key in ascending order, in pages of fixed size.
//!
//! The index of the evicted blocks lives under a hard cap. A list or a hash table would stand beside its larger copy when it
//! grows, when there may be no room left to make room; here growth is one page at a time, of a size that we know.

use crate::blocks::block_key::BlockKey;

/// Entries of a page. All pages but the last hold at least half as many.
const PAGE: usize = 32;

struct Page<V> {
    /// The first key, for the search over the pages.
    first: BlockKey,
    keys: Vec<BlockKey>,
    values: Vec<V>,
}

pub(crate) struct SortedPages<V> {
    pages: Vec<Page<V>>,
    len: usize,
}

impl<V> SortedPages<V> {
    const PAGE_BYTES: usize = PAGE * (size_of::<BlockKey>() + size_of::<V>());

    pub(crate) fn new() -> Self {
        Self { pages: Vec::new(), len: 0 }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// Bytes at the worst moment of inserting `added` more; not those the values point to.
    pub(crate) fn bytes_with(&self, added: usize) -> usize {
        let half_full = (self.len + added) / (PAGE / 2) + 1;
        let pages = (self.pages.len() + added).min(half_full).max(self.pages.len());
        let capacity = self.pages.capacity();
        // The list of pages stands beside its old self when it grows.
        let list = if pages > capacity { capacity + Self::capacity_for(pages) } else { capacity };
        list * size_of::<Page<V>>() + pages * Self::PAGE_BYTES
    }

    /// The list of pages grows by a quarter.
    fn capacity_for(pages: usize) -> usize {
        let mut capacity = 8;
        while capacity < pages {
            capacity += capacity / 4;
        }
        capacity
    }

    /// The page of a key, and its place there or where it would go.
    fn find(&self, key: BlockKey) -> Option<(usize, Result<usize, usize>)> {
        let page = self.pages.partition_point(|page| page.first <= key).saturating_sub(1);
        Some((page, self.pages.get(page)?.keys.binary_search(&key)))
    }

    pub(crate) fn get(&self, key: BlockKey) -> Option<&V> {
        let (page, at) = self.find(key)?;
        Some(&self.pages[page].values[at.ok()?])
    }

    pub(crate) fn get_mut(&mut self, key: BlockKey) -> Option<&mut V> {
        let (page, at) = self.find(key)?;
        Some(&mut self.pages[page].values[at.ok()?])
    }

    /// Inserts a key that is not there yet.
    pub(crate) fn insert(&mut self, key: BlockKey, value: V) {
        let (mut page, mut at) = match self.find(key) {
            None => (0, 0),
            Some((page, at)) => (page, at.unwrap_or_else(|at| at)),
        };
        self.len += 1;
        let full = self.pages.get(page).is_none_or(|page| page.keys.len() == PAGE);
        if full && page + 1 >= self.pages.len() && self.pages.get(page).is_none_or(|last| at == last.keys.len()) {
            // Ascending keys, as a file has them, fill whole pages.
            let end = self.pages.len();
            self.add_page(end, Page::new(key));
            (page, at) = (end, 0);
        } else if full {
            let upper = self.pages[page].split();
            self.add_page(page + 1, upper);
            if at > PAGE / 2 {
                (page, at) = (page + 1, at - PAGE / 2);
            }
        }
        self.pages[page].keys.insert(at, key);
        self.pages[page].values.insert(at, value);
        self.pages[page].first = self.pages[page].keys[0];
    }

    fn add_page(&mut self, at: usize, page: Page<V>) {
        if self.pages.len() == self.pages.capacity() {
            let more = Self::capacity_for(self.pages.len() + 1) - self.pages.len();
            self.pages.reserve_exact(more);
        }
        self.pages.insert(at, page);
    }

    pub(crate) fn remove(&mut self, key: BlockKey) -> Option<V> {
        let (page, at) = self.find(key)?;
        let at = at.ok()?;
        self.len -= 1;
        if self.len == 0 {
            // A list that has grown is given back.
            let mut all = std::mem::replace(self, Self::new());
            return all.pages.pop()?.values.pop();
        }
        self.pages[page].keys.remove(at);
        let value = self.pages[page].values.remove(at);
        self.refill(page);
        Some(value)
    }

    /// Restores that a page is half full, from a neighbour.
    fn refill(&mut self, page: usize) {
        if let Some(&first) = self.pages[page].keys.first() {
            self.pages[page].first = first;
        }
        if self.pages[page].keys.len() >= PAGE / 2 || self.pages.len() == 1 {
            return;
        }
        let lower = page.min(self.pages.len() - 2);
        let mut upper = self.pages.remove(lower + 1);
        let into = &mut self.pages[lower];
        let all = into.keys.len() + upper.keys.len();
        // Into one page, or evenly into two.
        let wanted = if all <= PAGE { all } else { all / 2 };
        if into.keys.len() <= wanted {
            let moved = wanted - into.keys.len();
            into.keys.extend(upper.keys.drain(..moved));
            into.values.extend(upper.values.drain(..moved));
        } else {
            upper.keys.splice(..0, into.keys.drain(wanted..));
            upper.values.splice(..0, into.values.drain(wanted..));
        }
        into.first = into.keys[0];
        if let Some(&first) = upper.keys.first() {
            upper.first = first;
            self.pages.insert(lower + 1, upper);
        }
    }

    /// All entries, ascending.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (BlockKey, &V)> {
        self.pages.iter().flat_map(Page::entries)
    }

    /// The first entry behind a key, else the first of all, that is `wanted`.
    pub(crate) fn next_after(&self, key: BlockKey, wanted: impl Fn(&V) -> bool) -> Option<(BlockKey, &V)> {
        let page = self.find(key)?.0;
        let mut behind = self.pages[page..].iter().flat_map(Page::entries).filter(|&(at, _)| at > key);
        behind.find(|(_, value)| wanted(value)).or_else(|| self.iter().find(|(_, value)| wanted(value)))
    }
}

impl<V> Page<V> {
    fn new(first: BlockKey) -> Self {
        Self { first, keys: Vec::with_capacity(PAGE), values: Vec::with_capacity(PAGE) }
    }

    fn entries(&self) -> impl Iterator<Item = (BlockKey, &V)> {
        self.keys.iter().copied().zip(&self.values)
    }

    /// Takes away the upper half of a full page.
    fn split(&mut self) -> Self {
        let mut upper = Self::new(self.keys[PAGE / 2]);
        upper.keys.extend(self.keys.drain(PAGE / 2..));
        upper.values.extend(self.values.drain(PAGE / 2..));
        upper
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::{PAGE, Page, SortedPages};
    use crate::blocks::block_key::BlockKey;
    use crate::hashing::mix64;

    fn check(pages: &SortedPages<u64>, oracle: &BTreeMap<BlockKey, u64>) {
        assert!(pages.len() == oracle.len() && pages.iter().eq(oracle.iter().map(|(&key, value)| (key, value))));
        let before_last = pages.pages.len().saturating_sub(1);
        for (k, page) in pages.pages.iter().enumerate() {
            assert!(page.first == page.keys[0] && page.keys.len() <= PAGE && page.keys.capacity() == PAGE);
            assert!(page.values.capacity() == PAGE && (k == before_last || page.keys.len() >= PAGE / 2));
        }
    }

    #[test]
    fn behaves_like_an_ordered_map_under_random_use() {
        let (mut pages, mut oracle) = (SortedPages::new(), BTreeMap::new());
        for step in 0..60_000_u64 {
            let r = mix64(step + 1);
            let key = BlockKey(r % 2000);
            // Grows, shrinks to nothing, grows again.
            let grows = step / 10_000 % 2 == 0;
            if (r >> 60 < 11) == grows {
                if oracle.insert(key, step).is_some() {
                    *pages.get_mut(key).unwrap() = step;
                } else {
                    let promised = pages.bytes_with(1);
                    pages.insert(key, step);
                    let list = pages.pages.capacity() * size_of::<Page<u64>>();
                    assert!(list + pages.pages.len() * SortedPages::<u64>::PAGE_BYTES <= promised);
                }
            } else {
                assert_eq!(pages.remove(key), oracle.remove(&key));
            }
            let probe = BlockKey(mix64(r) % 2000);
            assert_eq!(pages.get(probe), oracle.get(&probe));
            let odd = |value: &u64| value % 2 == 1;
            let expected = oracle.range(probe..).find(|(key, value)| **key > probe && odd(value));
            let expected = expected.or_else(|| oracle.iter().find(|(_, value)| odd(value)));
            assert_eq!(pages.next_after(probe, odd), expected.map(|(&key, value)| (key, value)));
            if step % 500 == 0 {
                check(&pages, &oracle);
            }
        }
        for key in oracle.keys().copied().collect::<Vec<_>>() {
            assert_eq!(pages.remove(key), oracle.remove(&key));
            check(&pages, &oracle);
        }
        assert_eq!(pages.bytes_with(0), SortedPages::<u64>::new().bytes_with(0));
    }

    #[test]
    fn ascending_keys_fill_whole_pages() {
        let mut pages = SortedPages::new();
        (0..10 * PAGE as u64).for_each(|key| pages.insert(BlockKey(key), key));
        assert_eq!(pages.pages.len(), 10);
    }
}
