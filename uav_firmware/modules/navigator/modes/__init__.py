"""The modes of the navigator but for missions, and the manoeuvres that they consist of."""
