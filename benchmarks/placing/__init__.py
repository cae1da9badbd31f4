"""How sure estimates are: fitted on synthetic towns alone, tested on real streets and cities."""
