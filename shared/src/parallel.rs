//! Threads and lanes: the two ways in which a kernel uses the machine.
//!
//! Neither changes a bit of any result: each cell is computed independently of the others, from
//! arrays that do not change meanwhile, by IEEE operations in one order.

/// The number of threads that a solve uses by default.
#[must_use]
pub fn default_threads() -> usize {
    #[cfg(not(target_arch = "wasm32"))]
    return rayon::current_num_threads();
    #[cfg(target_arch = "wasm32")]
    return 1;
}

/// The threads of one solve.
pub(super) struct Workers {
    #[cfg(not(target_arch = "wasm32"))]
    pool: Option<rayon::ThreadPool>,
}

impl Workers {
    /// `threads` workers. One worker is the caller's own thread, as when the system cannot start
    /// threads.
    pub(super) fn new(threads: usize) -> Self {
        #[cfg(not(target_arch = "wasm32"))]
        {
            let build = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
            Self { pool: if threads > 1 { build() } else { None } }
        }
        #[cfg(target_arch = "wasm32")]
        {
            let _ = threads;
            Self {}
        }
    }

    /// Calls `work(i, chunk)` for the `i`-th chunk of `length` entries of `data`.
    pub(super) fn for_chunks<T: Send>(
        &self,
        data: &mut [T],
        length: usize,
        work: impl Fn(usize, &mut [T]) + Sync,
    ) {
        #[cfg(not(target_arch = "wasm32"))]
        if let Some(pool) = &self.pool {
            use rayon::prelude::*;
            pool.install(|| {
                data.par_chunks_mut(length).enumerate().for_each(|(i, chunk)| work(i, chunk));
            });
            return;
        }
        for (i, chunk) in data.chunks_mut(length).enumerate() {
            work(i, chunk);
        }
    }
}

/// `work(item)` for each of `items`, in their order, on all threads there are.
///
/// # Errors
/// The error of the first item, in their order, for which `work` fails.
pub(crate) fn parallel_map<T: Sync, R: Send, E: Send>(
    items: &[T],
    work: impl Fn(&T) -> Result<R, E> + Sync + Send,
) -> Result<Vec<R>, E> {
    #[cfg(not(target_arch = "wasm32"))]
    {
        use rayon::prelude::*;
        let done: Vec<Result<R, E>> = items.par_iter().map(work).collect();
        done.into_iter().collect()
    }
    #[cfg(target_arch = "wasm32")]
    items.iter().map(work).collect()
}

/// `work(inputs, outputs)` for corresponding parts, of `part` entries, of two lists of one length, on all
/// threads there are.
pub(crate) fn parallel_parts<A: Sync, B: Send>(
    inputs: &[A],
    outputs: &mut [B],
    part: usize,
    work: impl Fn(&[A], &mut [B]) + Sync + Send,
) {
    #[cfg(not(target_arch = "wasm32"))]
    {
        use rayon::prelude::*;
        let parts = inputs.par_chunks(part).zip(outputs.par_chunks_mut(part));
        parts.for_each(|(inputs, outputs)| work(inputs, outputs));
    }
    #[cfg(target_arch = "wasm32")]
    for (inputs, outputs) in inputs.chunks(part).zip(outputs.chunks_mut(part)) {
        work(inputs, outputs);
    }
}

/// Work that is compiled once for every lane width.
pub(crate) trait Kernel {
    /// Must be `#[inline(always)]`, and so must every function that it calls.
    fn run(self);
}

/// Runs `kernel` with the widest lanes of this machine. In WebAssembly the build decides the width.
pub(crate) fn in_widest_lanes(kernel: impl Kernel) {
    #[cfg(not(target_arch = "wasm32"))]
    {
        struct Adapter<K>(K);
        impl<K: Kernel> pulp::NullaryFnOnce for Adapter<K> {
            type Output = ();
            #[inline(always)]
            fn call(self) {
                self.0.run();
            }
        }
        pulp::Arch::new().dispatch(Adapter(kernel));
    }
    #[cfg(target_arch = "wasm32")]
    {
        // A browser makes a function fast between two calls, never during one. As a part of its caller, which
        // runs once, the kernel would stay ten times as slow for the whole of a first solve.
        #[inline(never)]
        fn called(kernel: impl Kernel) {
            kernel.run();
        }
        called(kernel);
    }
}
