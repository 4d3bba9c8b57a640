//! How many threads a program uses: as many as asked for, else one for each core. Results do not depend on it.

/// Most threads that anybody can mean.
const MOST: usize = 1024;

/// The number of threads for `--threads`.
pub fn worker_threads(asked: Option<usize>) -> usize {
    asked.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from).min(MOST))
}

/// Reads `--threads`.
///
/// # Errors
/// What is none, or absurd.
pub fn parse(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|count| (1..=MOST).contains(count));
    count.ok_or_else(|| format!("give 1 to {MOST} threads"))
}
