// Two edits of one text: the edit of this window, and the edit of another one. Edits of different lines are joined. Edits of one
// line are not: two changed digits of one number would become a number that nobody typed.
(() => {
  'use strict';

  // An edit as one replaced range of the old text.
  const edit_between = (old, words) => {
    let from = 0, end = 0;
    while (from < old.length && from < words.length && old[from] === words[from]) from++;
    const most = Math.min(old.length, words.length) - from;
    while (end < most && old[old.length - 1 - end] === words[words.length - 1 - end]) end++;
    return { from, to: old.length - end, put: words.slice(from, words.length - end) };
  };

  // The range with the complete lines that it is in.
  const lines_of = (text, { from, to }) => {
    const end = text.indexOf('\n', to);
    return [text.lastIndexOf('\n', from - 1) + 1, end < 0 ? text.length : end];
  };

  // The text with both edits of `base`; null if both edit the same line.
  const merge = (base, own, theirs) => {
    if (own === base || own === theirs) return theirs;
    if (theirs === base) return own;
    const edits = [edit_between(base, own), edit_between(base, theirs)].sort((a, b) => a.from - b.from);
    const [one, other] = edits;
    if (lines_of(base, one)[1] >= lines_of(base, other)[0]) return null;
    return base.slice(0, one.from) + one.put + base.slice(one.to, other.from) + other.put + base.slice(other.to);
  };

  window.texts = { edit_between, merge };
})();
