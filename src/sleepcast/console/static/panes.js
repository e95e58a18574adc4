// The panes of a page that has other ones than those of a swarm: their module puts them in here before main.js begins.

export const own = { panes: null };
