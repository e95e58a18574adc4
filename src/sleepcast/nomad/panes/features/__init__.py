"""What only Nomads are asked by their page, a module for each feature; see `console.feature`."""
