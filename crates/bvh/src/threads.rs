//! Loops on all threads: rayon's, or without the feature `rayon` the same names on the calling thread.

#[cfg(feature = "rayon")]
pub(crate) use rayon::{current_num_threads, join, prelude::*};

#[cfg(not(feature = "rayon"))]
pub(crate) use sequential::*;

#[cfg(not(feature = "rayon"))]
mod sequential {
    pub(crate) fn current_num_threads() -> usize {
        1
    }

    pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
        (a(), b())
    }

    /// Rayon's methods of iterators that those of the standard library lack.
    pub(crate) trait IndexedParallelIterator: Iterator + Sized {
        fn with_min_len(self, _: usize) -> Self {
            self
        }

        fn with_max_len(self, _: usize) -> Self {
            self
        }

        fn chunks(self, len: usize) -> impl Iterator<Item = Vec<Self::Item>> {
            let mut rest = self.peekable();
            std::iter::from_fn(move || rest.peek().is_some().then(|| rest.by_ref().take(len).collect()))
        }

        fn map_init<S, R>(
            self,
            init: impl Fn() -> S,
            mut of: impl FnMut(&mut S, Self::Item) -> R,
        ) -> impl Iterator<Item = R> {
            let mut scratch = init();
            self.map(move |item| of(&mut scratch, item))
        }

        fn for_each_init<S>(self, init: impl Fn() -> S, mut of: impl FnMut(&mut S, Self::Item)) {
            let mut scratch = init();
            self.for_each(|item| of(&mut scratch, item));
        }

        fn flatten_iter(self) -> std::iter::Flatten<Self>
        where
            Self::Item: IntoIterator,
        {
            self.flatten()
        }

        fn find_map_first<R>(mut self, of: impl FnMut(Self::Item) -> Option<R>) -> Option<R> {
            self.find_map(of)
        }

        fn reduce_with(self, of: impl FnMut(Self::Item, Self::Item) -> Self::Item) -> Option<Self::Item> {
            self.reduce(of)
        }
    }

    impl<I: Iterator> IndexedParallelIterator for I {}

    pub(crate) trait IntoParallelIterator: IntoIterator + Sized {
        fn into_par_iter(self) -> Self::IntoIter {
            self.into_iter()
        }
    }

    impl<I: IntoIterator> IntoParallelIterator for I {}

    pub(crate) trait ParallelSlice<T> {
        fn par_iter(&self) -> std::slice::Iter<'_, T>;
        fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T>;
        fn par_chunks(&self, len: usize) -> std::slice::Chunks<'_, T>;
        fn par_chunks_mut(&mut self, len: usize) -> std::slice::ChunksMut<'_, T>;
        fn par_sort_unstable(&mut self)
        where
            T: Ord;
        fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K);
    }

    impl<T> ParallelSlice<T> for [T] {
        fn par_iter(&self) -> std::slice::Iter<'_, T> {
            self.iter()
        }

        fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
            self.iter_mut()
        }

        fn par_chunks(&self, len: usize) -> std::slice::Chunks<'_, T> {
            self.chunks(len)
        }

        fn par_chunks_mut(&mut self, len: usize) -> std::slice::ChunksMut<'_, T> {
            self.chunks_mut(len)
        }

        fn par_sort_unstable(&mut self)
        where
            T: Ord,
        {
            self.sort_unstable();
        }

        fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K) {
            self.sort_unstable_by_key(key);
        }
    }
}
