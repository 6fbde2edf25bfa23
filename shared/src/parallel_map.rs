//! One function for many items, on all threads.

/// `work(item)` for each of `items`, in their order, whatever the number of threads.
///
/// # Errors
/// The error of the first item, in their order, for which `work` fails.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn parallel_map<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    use rayon::prelude::*;
    let done: Vec<Result<R, E>> = items.par_iter().map(work).collect();
    done.into_iter().collect()
}

/// `work(item)` for each of `items`, in their order. A browser has one thread.
///
/// # Errors
/// The error of the first item for which `work` fails.
#[cfg(target_arch = "wasm32")]
pub(crate) fn parallel_map<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    items.iter().map(work).collect()
}
