//! Inputs and responses of a handler, derived from the types of its parameters and its result.

use super::operation::{Input, Operation, Output};
use super::schemas::Schemas;

/// A handler with parameters `I` and the result `O`.
pub trait Documented<I, O> {
    /// Adds the handler's inputs and responses.
    fn describe(operation: &mut Operation, schemas: &mut Schemas);
}

macro_rules! documented {
    ($($input:ident),*) => {
        impl<F, R, $($input),*> Documented<($($input,)*), R::Output> for F
        where
            F: Fn($($input),*) -> R,
            R: Future,
            R::Output: Output,
            $($input: Input),*
        {
            fn describe(operation: &mut Operation, schemas: &mut Schemas) {
                $($input::describe(operation, schemas);)*
                R::Output::describe(operation, schemas);
            }
        }
    };
}

documented!();
documented!(A);
documented!(A, B);
documented!(A, B, C);
documented!(A, B, C, D);
documented!(A, B, C, D, E);
documented!(A, B, C, D, E, G);
