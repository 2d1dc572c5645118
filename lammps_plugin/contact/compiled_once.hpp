#pragma once

#include "contact/extended.hpp"
#include "contact/math/dual.hpp"
#include "contact/pair_derivatives.hpp"

/// The contacts of a model in all scalars in use. With the keyword `extern`, at the end of a
/// shape's header, they are only declared, so that the files that use them do not compile them
/// again; without it, in the shape's contacts.cpp, they are compiled.
#define JAMSHAPE_CONTACTS(KEYWORD, MODEL)                                                          \
  JAMSHAPE_CONTACTS_IN(KEYWORD, MODEL, 2)                                                          \
  JAMSHAPE_CONTACTS_IN(KEYWORD, MODEL, 3)

#define JAMSHAPE_CONTACTS_IN(KEYWORD, MODEL, D)                                                    \
  JAMSHAPE_CONTACT(KEYWORD, MODEL, D, double)                                                      \
  JAMSHAPE_CONTACT(KEYWORD, MODEL, D, long double)                                                 \
  KEYWORD template ContactOf<MODEL, D> contact_in_long<MODEL, D>(                                  \
      const PosedPair<MODEL, D, long double> &);                                                   \
  KEYWORD template ContactOf<MODEL, D, Dual<PAIR_VARIABLES<D>>> turned_contact_in_long<MODEL, D>(  \
      const PosedPair<MODEL, D, long double> &);                                                   \
  KEYWORD template ContactDerivatives<MODEL, D, double> derivatives_at(                            \
      const PosedPair<MODEL, D, double> &);                                                        \
  KEYWORD template ContactErrors errors_at<MODEL, D>(const ContactOf<MODEL, D> &,                  \
                                                     const PosedPair<MODEL, D, long double> &);

#define JAMSHAPE_CONTACT(KEYWORD, MODEL, D, ...)                                                   \
  JAMSHAPE_CONTACT_OF(KEYWORD, MODEL, D, __VA_ARGS__)                                              \
  JAMSHAPE_CONTACT_OF(KEYWORD, MODEL, D, Dual<PAIR_VARIABLES<D>, __VA_ARGS__>)                     \
  KEYWORD template MODEL::Body<D, Dual<PAIR_VARIABLES<D>, __VA_ARGS__>>                            \
  turned_body<MODEL, D, __VA_ARGS__>(const MODEL::Shape &, const QuaternionOf<__VA_ARGS__> &,      \
                                     int);

#define JAMSHAPE_CONTACT_OF(KEYWORD, MODEL, D, ...)                                                \
  KEYWORD template ContactOf<MODEL, D, __VA_ARGS__> contact_of(                                    \
      const MODEL::Body<D, __VA_ARGS__> &, const MODEL::Body<D, __VA_ARGS__> &,                    \
      const MODEL::Law &);
