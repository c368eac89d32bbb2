//! SUE, chapter 5: how far to trust a match, from the spatial spread of the best references.
