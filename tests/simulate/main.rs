//! Tests of `videofields-simulate` through its public interface.

mod simulate;
mod worlds;
