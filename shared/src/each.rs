//! The same work for each of many things, on all threads where there are any.

/// `work` done for each of `items`, in their order, whatever the number of threads.
///
/// # Errors
/// That of the first item, in their order, whose work fails.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn each<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    use rayon::prelude::*;
    let done: Vec<Result<R, E>> = items.par_iter().map(work).collect();
    done.into_iter().collect()
}

/// `work` done for each of `items`, in their order. A browser has one thread.
///
/// # Errors
/// That of the first item whose work fails.
#[cfg(target_arch = "wasm32")]
pub(crate) fn each<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    items.iter().map(work).collect()
}
