//! Results by their inputs, so that a scene that is loaded again makes nothing anew of what it has in common with the one
//! before.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Results of a pure function, by inputs that are compared as a whole: what is found is what would be made.
#[derive(Debug)]
pub(crate) struct Memo<K, V> {
    /// `None` keeps nothing, and costs nothing.
    entries: Option<Mutex<Vec<Entry<K, V>>>>,
    made: AtomicU32,
    found: AtomicU32,
}

#[derive(Debug)]
struct Entry<K, V> {
    key: K,
    value: Arc<V>,
    used: bool,
}

impl<K, V> Default for Memo<K, V> {
    fn default() -> Self {
        Self { entries: None, made: AtomicU32::new(0), found: AtomicU32::new(0) }
    }
}

impl<K, V> Memo<K, V> {
    /// One that keeps what it makes.
    pub(crate) fn keeping() -> Self {
        Self { entries: Some(Mutex::default()), ..Self::default() }
    }

    /// Whether it keeps what it makes.
    pub(crate) fn keeps(&self) -> bool {
        self.entries.is_some()
    }

    /// The result for the key that `is_key` knows: an earlier one, or that of `make`, which is kept under `key`.
    ///
    /// # Errors
    /// Those of `make`.
    pub(crate) fn get<E>(
        &self,
        is_key: impl Fn(&K) -> bool,
        key: impl FnOnce() -> K,
        make: impl FnOnce() -> Result<V, E>,
    ) -> Result<Arc<V>, E> {
        let Some(entries) = &self.entries else { return make().map(Arc::new) };
        let entries = || entries.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(entry) = entries().iter_mut().find(|entry| is_key(&entry.key)) {
            entry.used = true;
            self.found.fetch_add(1, Ordering::Relaxed);
            return Ok(Arc::clone(&entry.value));
        }
        let value = Arc::new(make()?);
        self.made.fetch_add(1, Ordering::Relaxed);
        entries().push(Entry { key: key(), value: Arc::clone(&value), used: true });
        Ok(value)
    }

    /// Counts anew, after a round that came to nothing.
    pub(crate) fn count_anew(&self) {
        self.made.store(0, Ordering::Relaxed);
        self.found.store(0, Ordering::Relaxed);
    }

    /// Forgets what was not asked for since the last call. How many results were made since the counts began, and how many
    /// were asked for.
    pub(crate) fn sweep(&self) -> (u32, u32) {
        if let Some(entries) = &self.entries {
            let mut entries = entries.lock().unwrap_or_else(PoisonError::into_inner);
            entries.retain_mut(|entry| std::mem::take(&mut entry.used));
        }
        let (made, found) = (self.made.swap(0, Ordering::Relaxed), self.found.swap(0, Ordering::Relaxed));
        (made, made + found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(memo: &Memo<u32, u32>, x: u32) -> u32 {
        *memo.get::<()>(|key| *key == x, || x, || Ok(x * x)).unwrap()
    }

    #[test]
    fn what_was_asked_for_is_kept_and_the_rest_forgotten() {
        let memo = Memo::keeping();
        assert_eq!((square(&memo, 2), square(&memo, 3), square(&memo, 2)), (4, 9, 4));
        assert_eq!(memo.sweep(), (2, 3));
        assert_eq!(square(&memo, 3), 9);
        assert_eq!(memo.sweep(), (0, 1));
        assert_eq!(square(&memo, 2), 4);
        assert_eq!(memo.sweep(), (1, 1), "2 was not asked for in the round before");
        assert_eq!(memo.get(|_| false, || 5, || Err("no")), Err("no"));
        assert_eq!(memo.sweep(), (0, 0));
    }

    #[test]
    fn by_default_nothing_is_kept() {
        let memo = Memo::default();
        assert_eq!((square(&memo, 2), square(&memo, 2)), (4, 4));
        assert_eq!(memo.sweep(), (0, 0));
        assert!(!memo.keeps());
    }
}
