//! Warnings of a loader: one line for each feature that is not covered, however often the file uses it.

/// Anisotropy runs along tangents, and those along texture coordinates.
pub(super) const NO_DIRECTION: &str =
    "anisotropy on meshes without tangents and texture coordinates has no direction: their highlights are round";

/// Collects what could not be honoured, one entry a subject.
#[derive(Default)]
pub(super) struct Warnings {
    entries: Vec<Entry>,
}

struct Entry {
    subject: String,
    first_place: String,
    count: usize,
}

impl Warnings {
    /// Notes one occurrence at `place`. The subject is the whole message: what is not honoured, and what happens instead.
    pub(super) fn add(&mut self, subject: impl Into<String>, place: impl Into<String>) {
        let subject = subject.into();
        match self.entries.iter_mut().find(|entry| entry.subject == subject) {
            Some(entry) => entry.count += 1,
            None => self.entries.push(Entry { subject, first_place: place.into(), count: 1 }),
        }
    }

    /// Whether some subject begins like this.
    pub(super) fn has(&self, beginning: &str) -> bool {
        self.entries.iter().any(|entry| entry.subject.starts_with(beginning))
    }

    /// The lines, in the order in which the subjects were first met.
    pub(super) fn into_lines(self) -> Vec<String> {
        let line = |entry: Entry| match (entry.first_place.is_empty(), entry.count) {
            (true, _) => entry.subject,
            (false, 1) => format!("{} ({})", entry.subject, entry.first_place),
            (false, count) => format!("{} ({count} times, first at {})", entry.subject, entry.first_place),
        };
        self.entries.into_iter().map(line).collect()
    }
}
