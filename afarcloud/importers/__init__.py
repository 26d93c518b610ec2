"""Other spellings of the documents, brought to the canonical one before the types see them."""
