// What the page hands to a person: a file to keep, or text for the clipboard.

// Offer a file for download. parts: of its content, text or blobs.
export function download(name, type, parts) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob(parts, { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000); // a browser may ask first where to
}

// Put text on the clipboard; whether that was possible. A page that is not served from this machine may not do it.
export async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}

// A name for a file, from words.
export function fileName(words, ending) {
  const name = words.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 60);
  return `${name || "sleepcast"}.${ending}`;
}
