// Pictures that this browser keeps between two visits, by a name each. A browser may refuse to keep anything.

const [DATABASE, STORE] = ["sleepcast", "pictures"];
const MAX = 8; // pictures kept; the oldest goes

// The picture (a Blob) that is kept under a name, null if there is none.
export async function keptPicture(name) {
  const entry = await inStore("readonly", (store) => store.get(name));
  return entry?.blob ?? null;
}

// Keep a picture under a name, or (null) none.
export async function keepPicture(name, blob) {
  await inStore("readwrite", (store) => (blob ? store.put({ blob, at: Date.now() }, name) : store.delete(name)));
  const [names, all] = [await inStore("readonly", (store) => store.getAllKeys()), await inStore("readonly", (store) => store.getAll())];
  if (!names || names.length <= MAX) return;
  const oldest = all.reduce((least, { at }, place) => (at < all[least].at ? place : least), 0);
  await inStore("readwrite", (store) => store.delete(names[oldest]));
}

// The result of a request to the store, null where that cannot be.
async function inStore(mode, request) {
  try {
    const base = await done(Object.assign(indexedDB.open(DATABASE, 1), {
      onupgradeneeded: ({ target }) => target.result.createObjectStore(STORE),
    }));
    try {
      return await done(request(base.transaction(STORE, mode).objectStore(STORE)));
    } finally {
      base.close();
    }
  } catch {
    return null; // full or forbidden: the page works without
  }
}

function done(request) {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
