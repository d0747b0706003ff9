# find_package(btf) makes the targets btf::btf (the shared library) and btf::static.
get_filename_component(_btf_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_package(Threads REQUIRED)

if(NOT TARGET btf::btf)
  add_library(btf::btf SHARED IMPORTED)
  set_target_properties(btf::btf PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_btf_prefix}/include")
  add_library(btf::static STATIC IMPORTED)
  set_target_properties(btf::static PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_btf_prefix}/include")
  if(WIN32)
    set_target_properties(btf::btf PROPERTIES IMPORTED_LOCATION "${_btf_prefix}/bin/btf.dll"
                                              IMPORTED_IMPLIB "${_btf_prefix}/lib/btf.dll.lib")
    set_target_properties(btf::static PROPERTIES IMPORTED_LOCATION "${_btf_prefix}/lib/btf.lib"
                                                 INTERFACE_LINK_LIBRARIES "ws2_32;userenv;ntdll;bcrypt")
  else()
    set_target_properties(btf::btf PROPERTIES IMPORTED_LOCATION
                          "${_btf_prefix}/lib/libbtf${CMAKE_SHARED_LIBRARY_SUFFIX}")
    set_target_properties(btf::static PROPERTIES IMPORTED_LOCATION "${_btf_prefix}/lib/libbtf.a"
                                                 INTERFACE_LINK_LIBRARIES "Threads::Threads;${CMAKE_DL_LIBS};m")
  endif()
endif()
set(btf_FOUND TRUE)
