//! The edited document: the text of a model file and the text on disk. It detects when both have changed, and never
//! replaces one by the other by itself.
//!
//! Decision: two texts are never merged. If another program and the page both changed the file, both texts stay until
//! the user chooses. The file is read again right before it is replaced; the remaining gap of less than a millisecond
//! cannot be closed portably.
//!
//! Decision: the file is read and compared four times a second. Notifications of the system are missing on some disks,
//! differ when an editor replaces a file, and would have to be confirmed by reading anyway.

use std::borrow::Cow;

/// The text of a model file that is edited.
#[derive(Debug)]
pub(crate) struct EditedDocument {
    /// The text as it is edited.
    text: String,
    /// The text on disk when it was last read or written.
    saved: String,
    /// The text that another program wrote to the disk while the edited text had unsaved changes.
    outside: Option<String>,
    /// Counts the changes of the text.
    revision: u64,
}

/// Result of a comparison with the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DiskChange {
    /// No new change on disk.
    Unchanged,
    /// The text had no unsaved changes and was replaced by that on disk.
    Reloaded,
    /// Both texts have changed: the user must choose.
    Conflict,
}

impl EditedDocument {
    /// A document with the text of the disk; revisions are counted from `revision`.
    pub(crate) fn new(text: String, revision: u64) -> Self {
        Self {
            saved: text.clone(),
            text,
            outside: None,
            revision,
        }
    }

    /// The text as it is edited.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// The text as it was last read or written.
    #[cfg(test)]
    fn saved(&self) -> &str {
        &self.saved
    }

    /// Counts the changes of the text.
    pub(crate) fn revision(&self) -> u64 {
        self.revision
    }

    /// Whether the text has unsaved changes.
    pub(crate) fn is_changed(&self) -> bool {
        self.text != self.saved
    }

    /// Whether another program changed the file while the text had unsaved changes.
    pub(crate) fn is_in_conflict(&self) -> bool {
        self.outside.is_some()
    }

    /// Accepts a new text that was edited from revision `base`. Returns false without a change if `base` is not the
    /// last revision and the texts differ. Pages end lines with a line feed only; if the file has carriage returns, the
    /// new text gets them too.
    pub(crate) fn edit(&mut self, base: u64, text: &str) -> bool {
        let text = self.with_ends_of_lines(text);
        let text = text.as_ref();
        if base != self.revision {
            return self.text == text;
        }
        if self.text != text {
            text.clone_into(&mut self.text);
            self.revision += 1;
        }
        true
    }

    /// The text with the line ends that most lines of the saved text have.
    fn with_ends_of_lines<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let returns = self.saved.matches("\r\n").count();
        if 2 * returns > self.saved.matches('\n').count() && !text.contains('\r') {
            Cow::Owned(text.replace('\n', "\r\n"))
        } else {
            Cow::Borrowed(text)
        }
    }

    /// Compares with the text on disk, and loads it if no unsaved change would be lost.
    pub(crate) fn update_from_disk(&mut self, disk: &str) -> DiskChange {
        if disk == self.saved {
            self.outside = None;
            return DiskChange::Unchanged;
        }
        if disk == self.text {
            self.mark_saved();
            return DiskChange::Unchanged;
        }
        if self.is_changed() {
            if self.outside.as_deref() == Some(disk) {
                return DiskChange::Unchanged;
            }
            self.outside = Some(disk.to_owned());
            return DiskChange::Conflict;
        }
        disk.clone_into(&mut self.text);
        self.mark_saved();
        self.revision += 1;
        DiskChange::Reloaded
    }

    /// Notes that the text is now on disk.
    pub(crate) fn mark_saved(&mut self) {
        self.saved.clone_from(&self.text);
        self.outside = None;
    }

    /// Resolves a conflict: the text stays and may be saved over that of the other program. A later change by that
    /// program is a new conflict.
    pub(crate) fn keep_own_text(&mut self) {
        if let Some(outside) = self.outside.take() {
            self.saved = outside;
        }
    }

    /// Resolves a conflict: the text of the other program replaces the edited one.
    pub(crate) fn accept_outside_text(&mut self) {
        if let Some(outside) = self.outside.take() {
            self.text = outside;
            self.mark_saved();
            self.revision += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_write_is_followed_where_nothing_is_lost() {
        let mut document = EditedDocument::new("a".to_owned(), 1);
        assert_eq!(document.update_from_disk("a"), DiskChange::Unchanged);
        assert_eq!(document.update_from_disk("b"), DiskChange::Reloaded);
        assert_eq!((document.text(), document.saved(), document.revision()), ("b", "b", 2));
        assert!(!document.is_changed());
        // An edit made of the text before is too late.
        assert!(!document.edit(1, "late"));
        assert_eq!(document.text(), "b");
        assert!(document.edit(2, "mine"));
        assert_eq!(document.update_from_disk("mine"), DiskChange::Unchanged);
        assert!(!document.is_changed());
    }

    #[test]
    fn lines_end_as_they_did() {
        let mut document = EditedDocument::new("a\r\nb\r\n".to_owned(), 1);
        assert!(document.edit(1, "a\nb\n"));
        assert!(!document.is_changed());
        assert!(document.edit(1, "a\nc\nb\n"));
        assert_eq!(document.text(), "a\r\nc\r\nb\r\n");
        let mut document = EditedDocument::new("a\nb\n".to_owned(), 1);
        assert!(document.edit(1, "a\nc\n"));
        assert_eq!(document.text(), "a\nc\n");
    }

    #[test]
    fn both_texts_stay_until_somebody_chooses() {
        let conflict = || {
            let mut document = EditedDocument::new("a".to_owned(), 1);
            assert!(document.edit(1, "mine"));
            assert_eq!(document.update_from_disk("theirs"), DiskChange::Conflict);
            assert_eq!(document.update_from_disk("theirs"), DiskChange::Unchanged);
            assert!(document.is_in_conflict() && document.text() == "mine");
            document
        };
        let mut document = conflict();
        document.keep_own_text();
        assert!(document.is_changed() && !document.is_in_conflict());
        // A further change by others is a further conflict.
        assert_eq!(document.update_from_disk("theirs"), DiskChange::Unchanged);
        assert_eq!(document.update_from_disk("theirs again"), DiskChange::Conflict);
        let mut document = conflict();
        document.accept_outside_text();
        assert_eq!((document.text(), document.saved()), ("theirs", "theirs"));
        // What goes back to what it was is no conflict any more.
        let mut document = conflict();
        assert_eq!(document.update_from_disk("a"), DiskChange::Unchanged);
        assert!(!document.is_in_conflict() && document.text() == "mine");
    }
}
