//! `#[derive(Inputs)]` and `#[derive(Outputs)]`: the fields of a struct as the named ports of an operator.
//!
//! Both are exported by `swerve-flow`, whose documentation describes the ports.

mod fields;
mod inputs;
mod outputs;

use proc_macro::TokenStream;
use syn::{DeriveInput, parse_macro_input};

/// Makes the fields of a struct the input ports of an operator, each under its own name.
///
/// A field is an `At<T>`, `Latest<T>`, `Window<T, N>` or `Every`, an `Option` of one (a port that may stay
/// unconnected) or a `Vec` of one (any number of streams). Its doc comment documents the port. `#[port(feedback)]`
/// marks a port that closes a loop, `#[port(raw)]` one that reads its stream before faults are injected.
#[proc_macro_derive(Inputs, attributes(port))]
pub fn derive_inputs(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    inputs::derive(&input).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Makes the fields of a struct the output ports of an operator: each a `Port<T>`, whose stream is called
/// `operator.field`, or `operator` where it is the only one.
#[proc_macro_derive(Outputs, attributes(port))]
pub fn derive_outputs(input: TokenStream) -> TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    outputs::derive(&input).unwrap_or_else(syn::Error::into_compile_error).into()
}
