//! `#[derive(Inputs)]`.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{DeriveInput, Error, Ident};

use crate::fields::{Field, fields};

pub(crate) fn derive(input: &DeriveInput) -> Result<TokenStream, Error> {
    let fields = fields(input)?;
    let inputs = inputs(input, &fields);
    let named = named(input, &fields);
    let connect = connect(input, &fields);
    Ok(quote! { #inputs #named #connect })
}

/// Implements `Inputs`: the struct as the input of a step.
fn inputs(input: &DeriveInput, fields: &[Field<'_>]) -> TokenStream {
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let idents: Vec<_> = fields.iter().map(|field| field.ident).collect();
    let types: Vec<_> = fields.iter().map(|field| field.ty).collect();
    let indices = (0..fields.len()).map(syn::Index::from);
    quote! {
        #[automatically_derived]
        impl #generics ::swerve_flow::Inputs for #name #arguments #bounds {
            type Layout = (#(<#types as ::swerve_flow::Inputs>::Layout,)*);

            #[inline(always)]
            fn read(layout: &Self::Layout, slots: &mut ::swerve_flow::Slots<'_>) -> Self {
                let (_, _) = (layout, &slots);
                let input = Self { #(#idents: <#types as ::swerve_flow::Inputs>::read(&layout.#indices, slots),)* };
                // Marks the fields as used: nothing else reads a timer that only triggers the operator.
                #(let _ = &input.#idents;)*
                input
            }
        }
    }
}

/// Implements `NamedInputs`: the struct as a list of ports, to be wired one by one.
fn named(input: &DeriveInput, fields: &[Field<'_>]) -> TokenStream {
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let types: Vec<_> = fields.iter().map(|field| field.ty).collect();
    let indices = 0..fields.len();
    let ports = fields.iter().map(|field| {
        let Field { ty, name, doc, feedback, raw, .. } = field;
        let check = feedback.then(|| {
            quote! {
                const {
                    assert!(
                        <#ty as ::swerve_flow::InputPort>::MODE.reads_feedback(),
                        "`#[port(feedback)]` is for `Latest` and `Window` ports",
                    )
                };
            }
        });
        quote! {{
            #check
            ::swerve_flow::PortInfo {
                feedback: #feedback,
                raw: #raw,
                ..::swerve_flow::PortInfo::new::<#ty>(#name, #doc)
            }
        }}
    });
    quote! {
        #[automatically_derived]
        impl #generics ::swerve_flow::NamedInputs for #name #arguments #bounds {
            fn ports() -> ::std::vec::Vec<::swerve_flow::PortInfo> {
                ::std::vec![#(#ports),*]
            }

            fn layout(wires: &[::swerve_flow::Wire]) -> Self::Layout {
                let _ = wires;
                (#(<#types as ::swerve_flow::InputPort>::layout(&wires[#indices]),)*)
            }
        }
    }
}

/// Implements `Connect`: a tuple of streams and timers, in the order of the fields, connects to the struct.
fn connect(input: &DeriveInput, fields: &[Field<'_>]) -> TokenStream {
    let name = &input.ident;
    let (_, arguments, _) = input.generics.split_for_impl();
    let sources: Vec<Ident> = (0..fields.len()).map(|i| format_ident!("Source{i}__")).collect();
    let mut generics = input.generics.clone();
    for (source, field) in sources.iter().zip(fields) {
        let ty = field.ty;
        generics.params.push(syn::parse_quote!(#source: ::swerve_flow::Connect<#ty>));
    }
    let (generics, _, bounds) = generics.split_for_impl();
    let indices = (0..fields.len()).map(syn::Index::from);
    quote! {
        #[automatically_derived]
        #[allow(non_camel_case_types)]
        impl #generics ::swerve_flow::Connect<#name #arguments> for (#(#sources,)*) #bounds {
            fn connect(
                self,
                ports: &mut ::swerve_flow::Ports,
            ) -> <#name #arguments as ::swerve_flow::Inputs>::Layout {
                let _ = &ports;
                (#(self.#indices.connect(ports),)*)
            }
        }
    }
}
