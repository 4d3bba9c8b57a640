//! Work in contiguous chunks, on as many threads as the caller asked for.

/// Calls `work` on consecutive chunks of `items` and returns its results in their order. With one thread, or one chunk,
/// nothing is spawned.
pub(crate) fn in_chunks<T: Send, R: Send>(
    items: &mut [T],
    threads: usize,
    work: impl Fn(&mut [T]) -> R + Sync,
) -> Vec<R> {
    if threads <= 1 || items.len() <= 1 {
        return vec![work(items)];
    }
    let size = items.len().div_ceil(threads);
    std::thread::scope(|scope| {
        let handles: Vec<_> = items.chunks_mut(size).map(|chunk| scope.spawn(|| work(chunk))).collect();
        handles
            .into_iter()
            .map(|handle| handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}
