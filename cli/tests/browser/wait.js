// What tests of a page in a browser need: waiting for what is to come, and finding places in the text.
window.until = async (what, holds, ms = 60000) => {
  const start = performance.now();
  for (;;) {
    const found = holds();
    if (found) return found;
    if (performance.now() - start > ms) throw new Error(`waited in vain for ${what}`);
    await new Promise((done) => setTimeout(done, 5));
  }
};
window.at = (id) => document.getElementById(id);
// Selects a piece of the text, so that what is typed takes its place.
window.select = (piece) => {
  const text = document.getElementById('text');
  const start = text.value.indexOf(piece);
  if (start < 0) throw new Error(`the text has no ${piece}`);
  text.focus();
  text.setSelectionRange(start, start + piece.length);
};
window.tab = (name) => document.querySelector(`[data-pane="${name}"]`).click();
