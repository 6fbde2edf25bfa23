//! The buffer of a query. It is on the stack unless there are very many steps.

use core::ops::{Deref, DerefMut};

/// Largest number of elements that need no allocation.
const INLINE: usize = 130;

/// A fixed number of elements, initialised with the default value.
#[derive(Clone, Debug)]
pub(super) struct Buffer<T> {
    inline: [T; INLINE],
    heap: Vec<T>,
    len: usize,
}

impl<T: Copy + Default> Buffer<T> {
    pub(super) fn new(len: usize) -> Self {
        let heap = if len > INLINE { vec![T::default(); len] } else { Vec::new() };
        Self { inline: [T::default(); INLINE], heap, len }
    }
}

impl<T> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        if self.len > INLINE { &self.heap } else { &self.inline[..self.len] }
    }
}

impl<T> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if self.len > INLINE { &mut self.heap } else { &mut self.inline[..self.len] }
    }
}
