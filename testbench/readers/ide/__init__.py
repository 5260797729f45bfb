"""enDAQ recordings (``.IDE``). ``elements`` checks that the file is whole, ``library`` reads it with idelib."""
