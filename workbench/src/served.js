// Requests to a server, with the token of the link.
(() => {
  'use strict';
  const token = new URLSearchParams(location.search).get('token');
  const UNANSWERED = 'The program does not answer; it may have ended. Keep this page open: it still has your text. Download the text, or copy it to a file, before you close the page.';
  const ask = async (question, body) => {
    const answer = await fetch(`/api/${question}`, {
      method: body === undefined ? 'GET' : 'POST',
      headers: { 'x-modelmill-token': token, 'content-type': 'application/json' },
      body: body === undefined ? undefined : JSON.stringify(body),
    }).catch(() => { throw Object.assign(new Error(UNANSWERED), { isUnanswered: true }); });
    const isJson = (answer.headers.get('content-type') || '').includes('json');
    const told = isJson ? await answer.json() : await answer.text();
    if (answer.ok) return told;
    throw Object.assign(new Error(isJson ? told.says : told), { status: answer.status });
  };
  // `news` returns the view once its version differs.
  window.mill = { ask, news: (version) => ask(`view?since=${version}`), keeps: true, hint: 'No recording is open: start the workbench with --data.' };
})();
