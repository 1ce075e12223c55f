//! The text that is edited, beside what the disk holds. It knows when both went different ways, and never takes one for the
//! other by itself.
//!
//! Decision: two texts are never merged. If another program and the page both changed the file, both texts stay
//! until the user chooses. The file is read again right before it is replaced; the remaining gap of less than a
//! millisecond cannot be closed portably.
//!
//! Decision: the file is read and compared four times a second. Notifications of the system are missing on some
//! disks, differ when an editor replaces a file, and would have to be confirmed by reading anyway.

use std::borrow::Cow;

/// The text of a model file that is edited.
#[derive(Debug)]
pub(crate) struct Draft {
    /// The text as it is edited.
    text: String,
    /// What the disk held when the text was last read from it or written to it.
    saved: String,
    /// What another program wrote to the disk meanwhile, while the text had changes of its own.
    outside: Option<String>,
    /// Counts the changes of the text.
    revision: u64,
}

/// What came of a look at the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Seen {
    /// Nothing that was not known.
    Nothing,
    /// The text had no changes of its own and is now what the disk holds.
    Followed,
    /// Both have changes: somebody must choose.
    Conflict,
}

impl Draft {
    /// What was just read from the disk; its changes count from `revision`.
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

    /// Whether there is anything that the disk does not hold.
    pub(crate) fn is_changed(&self) -> bool {
        self.text != self.saved
    }

    /// Whether another program wrote something that the text does not hold.
    pub(crate) fn is_in_conflict(&self) -> bool {
        self.outside.is_some()
    }

    /// Takes a new text that was made of revision `base`; false, and nothing done, if that is not the last one. Pages end lines
    /// with a line feed only; where the file has carriage returns before them, the new text gets them too.
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

    fn with_ends_of_lines<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let returns = self.saved.matches("\r\n").count();
        if 2 * returns > self.saved.matches('\n').count() && !text.contains('\r') {
            Cow::Owned(text.replace('\n', "\r\n"))
        } else {
            Cow::Borrowed(text)
        }
    }

    /// Looks at what the disk holds.
    pub(crate) fn see(&mut self, disk: &str) -> Seen {
        if disk == self.saved {
            self.outside = None;
            return Seen::Nothing;
        }
        if disk == self.text {
            self.written();
            return Seen::Nothing;
        }
        if self.is_changed() {
            if self.outside.as_deref() == Some(disk) {
                return Seen::Nothing;
            }
            self.outside = Some(disk.to_owned());
            return Seen::Conflict;
        }
        disk.clone_into(&mut self.text);
        self.written();
        self.revision += 1;
        Seen::Followed
    }

    /// The disk holds the text now.
    pub(crate) fn written(&mut self) {
        self.saved.clone_from(&self.text);
        self.outside = None;
    }

    /// Ends a conflict: the text stays, and may be saved over what the other program wrote; what it writes later is a conflict
    /// again.
    pub(crate) fn keep(&mut self) {
        if let Some(outside) = self.outside.take() {
            self.saved = outside;
        }
    }

    /// Ends a conflict: what the other program wrote takes the place of the text.
    pub(crate) fn take(&mut self) {
        if let Some(outside) = self.outside.take() {
            self.text = outside;
            self.written();
            self.revision += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_write_is_followed_where_nothing_is_lost() {
        let mut draft = Draft::new("a".to_owned(), 1);
        assert_eq!(draft.see("a"), Seen::Nothing);
        assert_eq!(draft.see("b"), Seen::Followed);
        assert_eq!(
            (draft.text(), draft.saved(), draft.revision()),
            ("b", "b", 2)
        );
        assert!(!draft.is_changed());
        // An edit made of the text before is too late.
        assert!(!draft.edit(1, "late"));
        assert_eq!(draft.text(), "b");
        assert!(draft.edit(2, "mine"));
        assert_eq!(draft.see("mine"), Seen::Nothing);
        assert!(!draft.is_changed());
    }

    #[test]
    fn lines_end_as_they_did() {
        let mut draft = Draft::new("a\r\nb\r\n".to_owned(), 1);
        assert!(draft.edit(1, "a\nb\n"));
        assert!(!draft.is_changed());
        assert!(draft.edit(1, "a\nc\nb\n"));
        assert_eq!(draft.text(), "a\r\nc\r\nb\r\n");
        let mut draft = Draft::new("a\nb\n".to_owned(), 1);
        assert!(draft.edit(1, "a\nc\n"));
        assert_eq!(draft.text(), "a\nc\n");
    }

    #[test]
    fn both_texts_stay_until_somebody_chooses() {
        let conflict = || {
            let mut draft = Draft::new("a".to_owned(), 1);
            assert!(draft.edit(1, "mine"));
            assert_eq!(draft.see("theirs"), Seen::Conflict);
            assert_eq!(draft.see("theirs"), Seen::Nothing);
            assert!(draft.is_in_conflict() && draft.text() == "mine");
            draft
        };
        let mut draft = conflict();
        draft.keep();
        assert!(draft.is_changed() && !draft.is_in_conflict());
        // A further change by others is a further conflict.
        assert_eq!(draft.see("theirs"), Seen::Nothing);
        assert_eq!(draft.see("theirs again"), Seen::Conflict);
        let mut draft = conflict();
        draft.take();
        assert_eq!((draft.text(), draft.saved()), ("theirs", "theirs"));
        // What goes back to what it was is no conflict any more.
        let mut draft = conflict();
        assert_eq!(draft.see("a"), Seen::Nothing);
        assert!(!draft.is_in_conflict() && draft.text() == "mine");
    }
}
