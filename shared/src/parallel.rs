//! Parallelism: threads and SIMD lanes.
//!
//! The number of threads and the SIMD width do not change a single bit of any result. Each cell is
//! computed independently of the others, with IEEE operations in a fixed order, from arrays that
//! are read-only during the computation.

use crate::invalid::Invalid;

/// The number of threads that a solve uses by default.
#[must_use]
pub fn default_threads() -> usize {
    #[cfg(not(target_arch = "wasm32"))]
    return rayon::current_num_threads();
    #[cfg(target_arch = "wasm32")]
    return 1;
}

/// The worker threads of one solve.
pub(super) struct Workers {
    #[cfg(not(target_arch = "wasm32"))]
    pool: Option<rayon::ThreadPool>,
}

impl Workers {
    /// Creates `threads` workers. A single worker runs on the caller's thread, and so does all work
    /// if the system cannot start threads.
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

/// Calls `work(item)` for each of `items` on all available threads, and returns the results in
/// order.
///
/// # Errors
/// The error of the first item, in list order, for which `work` fails.
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

/// Calls `work(inputs, outputs)` on all available threads, for corresponding chunks of `part`
/// entries of two lists of the same length.
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

/// Work that is compiled once for each lane width.
pub(crate) trait Kernel {
    /// Must be `#[inline(always)]`, and so must every function that it calls.
    fn run(self);
}

/// The SIMD width of a solve. Results are bit-identical for every width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Lanes {
    /// 128 bits, available on every machine.
    Bits128,
    /// 256 bits (AVX2).
    Bits256,
    /// 512 bits (AVX-512).
    Bits512,
}

impl Lanes {
    /// The widest lanes that this machine supports.
    #[must_use]
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if pulp::x86::V4::try_new().is_some() {
                return Self::Bits512;
            }
            if pulp::x86::V3::try_new().is_some() {
                return Self::Bits256;
            }
        }
        Self::Bits128
    }

    /// The name of the instruction set: `128-bit`, `avx2` or `avx512`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bits128 => "128-bit",
            Self::Bits256 => "avx2",
            Self::Bits512 => "avx512",
        }
    }

    /// The lanes with this name.
    ///
    /// # Errors
    /// [`Invalid`] for any other name.
    pub fn named(name: &str) -> Result<Self, Invalid> {
        let all = [Self::Bits128, Self::Bits256, Self::Bits512];
        all.into_iter()
            .find(|lanes| lanes.name() == name)
            .ok_or_else(|| Invalid::new("lanes", "128-bit, avx2 or avx512", name))
    }
}

/// Runs `kernel` with the widest lanes of this machine. In WebAssembly the build decides the width.
pub(crate) fn in_widest_lanes(kernel: impl Kernel) {
    in_lanes(Lanes::Bits512, kernel);
}

/// Runs `kernel` with the widest lanes of this machine that are no wider than `most`.
pub(crate) fn in_lanes(most: Lanes, kernel: impl Kernel) {
    // A browser switches a function to optimised code between two calls, never during a call. If
    // the kernel were inlined into its caller, which runs once, it would stay ten times as slow for
    // the whole first solve.
    #[inline(never)]
    fn called(kernel: impl Kernel) {
        kernel.run();
    }
    #[cfg(target_arch = "x86_64")]
    {
        struct Adapter<K>(K);
        impl<K: Kernel> pulp::NullaryFnOnce for Adapter<K> {
            type Output = ();
            #[inline(always)]
            fn call(self) {
                self.0.run();
            }
        }
        if let (Lanes::Bits512, Some(wide)) = (most, pulp::x86::V4::try_new()) {
            return wide.vectorize(Adapter(kernel));
        }
        if let (Lanes::Bits256 | Lanes::Bits512, Some(wide)) = (most, pulp::x86::V3::try_new()) {
            return wide.vectorize(Adapter(kernel));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = most;
    called(kernel);
}
