// What the page asks its server. Addresses are relative: the token is in front of them.

export class ServerError extends Error {
  constructor(message, { status = 0, changed = false } = {}) {
    super(message);
    this.status = status;
    this.changed = changed;
  }
}

async function ask(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch {
    throw new ServerError("besman does not answer: it was stopped, or this machine is busy");
  }
  if (answer.ok) return answer;
  let about = {};
  try {
    about = await answer.json();
  } catch {
    // Then the status has to do.
  }
  throw new ServerError(about.error ?? `besman answered with status ${answer.status}`, {
    status: answer.status,
    changed: Boolean(about.changed),
  });
}

const address = (name, query) => `${name}?${new URLSearchParams(query)}`;

/** Return what JSON an address holds. */
export async function getJson(name, query = {}) {
  return (await ask(address(name, query))).json();
}

/** Return what numbers an address holds, 4 bytes each. */
export async function getNumbers(name, query = {}) {
  return new Float32Array(await (await ask(address(name, query))).arrayBuffer());
}

/** Send JSON and return the answer's. */
export async function postJson(name, content) {
  const answer = await ask(name, {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(content),
  });
  return answer.json();
}
