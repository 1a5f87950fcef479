"""The functions called in kernels, in LLVM's intermediate representation.

Draws follow numpy's PCG64: the 128-bit state and increment, lower words first, a flag, a half word.
"""

RUNTIME = """
declare double @llvm.sqrt.f64(double)
declare i64 @llvm.ctlz.i64(i64, i1)

define void @NRT_incref(ptr %p) alwaysinline {
  ret void
}

define void @NRT_decref(ptr %p) alwaysinline {
  ret void
}

define double @sqrt(double %x) alwaysinline {
  %root = call double @llvm.sqrt.f64(double %x)
  ret double %root
}

define double @numba_frexp(double %x, ptr %exponent) {
  %bits = bitcast double %x to i64
  %magnitude = and i64 %bits, 9223372036854775807
  %zero = icmp eq i64 %magnitude, 0
  %whole = icmp uge i64 %magnitude, 9218868437227405312
  %odd = or i1 %zero, %whole
  br i1 %odd, label %same, label %split
same:
  store i32 0, ptr %exponent
  ret double %x
split:
  %small = icmp ult i64 %magnitude, 4503599627370496
  %larger = fmul double %x, 0x4350000000000000
  %normal = select i1 %small, double %larger, double %x
  %shift = select i1 %small, i64 1076, i64 1022
  %normal_bits = bitcast double %normal to i64
  %raised = lshr i64 %normal_bits, 52
  %field = and i64 %raised, 2047
  %power = sub i64 %field, %shift
  %power32 = trunc i64 %power to i32
  store i32 %power32, ptr %exponent
  %rest = and i64 %normal_bits, -9218868437227405313
  %fraction = or i64 %rest, 4602678819172646912
  %result = bitcast i64 %fraction to double
  ret double %result
}

define double @evoros.remainder(double %x, double %y) {
entry:
  %x_bits = bitcast double %x to i64
  %y_bits = bitcast double %y to i64
  %sign = and i64 %x_bits, -9223372036854775808
  %x_size = and i64 %x_bits, 9223372036854775807
  %y_size = and i64 %y_bits, 9223372036854775807
  %y_zero = icmp eq i64 %y_size, 0
  %y_odd = icmp ugt i64 %y_size, 9218868437227405312
  %x_odd = icmp uge i64 %x_size, 9218868437227405312
  %odd = or i1 %y_odd, %x_odd
  %none = or i1 %odd, %y_zero
  br i1 %none, label %no_number, label %number
no_number:
  %product = fmul double %x, %y
  %quotient = fdiv double %product, %product
  ret double %quotient
number:
  %less = icmp ult i64 %x_size, %y_size
  br i1 %less, label %whole, label %divide
whole:
  ret double %x
divide:
  %x_zeros = call i64 @llvm.ctlz.i64(i64 %x_size, i1 false)
  %y_zeros = call i64 @llvm.ctlz.i64(i64 %y_size, i1 false)
  %x_small = icmp ult i64 %x_size, 4503599627370496
  %y_small = icmp ult i64 %y_size, 4503599627370496
  %x_shift = sub i64 %x_zeros, 11
  %y_shift = sub i64 %y_zeros, 11
  %x_raised = shl i64 %x_size, %x_shift
  %y_raised = shl i64 %y_size, %y_shift
  %x_low = and i64 %x_size, 4503599627370495
  %y_low = and i64 %y_size, 4503599627370495
  %x_normal = or i64 %x_low, 4503599627370496
  %y_normal = or i64 %y_low, 4503599627370496
  %x_fraction = select i1 %x_small, i64 %x_raised, i64 %x_normal
  %y_fraction = select i1 %y_small, i64 %y_raised, i64 %y_normal
  %x_field = lshr i64 %x_size, 52
  %y_field = lshr i64 %y_size, 52
  %x_below = sub i64 1, %x_shift
  %y_below = sub i64 1, %y_shift
  %x_power = select i1 %x_small, i64 %x_below, i64 %x_field
  %y_power = select i1 %y_small, i64 %y_below, i64 %y_field
  br label %loop
loop:
  %power = phi i64 [ %x_power, %divide ], [ %lower, %next ]
  %rest = phi i64 [ %x_fraction, %divide ], [ %doubled, %next ]
  %difference = sub i64 %rest, %y_fraction
  %negative = icmp slt i64 %difference, 0
  %kept = select i1 %negative, i64 %rest, i64 %difference
  %more = icmp sgt i64 %power, %y_power
  br i1 %more, label %next, label %end
next:
  %doubled = shl i64 %kept, 1
  %lower = sub i64 %power, 1
  br label %loop
end:
  %zero = icmp eq i64 %kept, 0
  br i1 %zero, label %nothing, label %something
nothing:
  %signed_zero = bitcast i64 %sign to double
  ret double %signed_zero
something:
  %zeros = call i64 @llvm.ctlz.i64(i64 %kept, i1 false)
  %shift = sub i64 %zeros, 11
  %fraction = shl i64 %kept, %shift
  %result_power = sub i64 %y_power, %shift
  %normal = icmp sgt i64 %result_power, 0
  %low = and i64 %fraction, 4503599627370495
  %field = shl i64 %result_power, 52
  %normal_bits = or i64 %low, %field
  %down = sub i64 1, %result_power
  %down_bounded = and i64 %down, 63
  %small_bits = lshr i64 %fraction, %down_bounded
  %size = select i1 %normal, i64 %normal_bits, i64 %small_bits
  %bits = or i64 %size, %sign
  %result = bitcast i64 %bits to double
  ret double %result
}

define i64 @evoros.next_uint64(i64 %generator) {
  %place = inttoptr i64 %generator to ptr
  %high_place = getelementptr i64, ptr %place, i64 1
  %step_place = getelementptr i64, ptr %place, i64 2
  %step_high_place = getelementptr i64, ptr %place, i64 3
  %low = load i64, ptr %place
  %high = load i64, ptr %high_place
  %step_low = load i64, ptr %step_place
  %step_high = load i64, ptr %step_high_place
  %low128 = zext i64 %low to i128
  %high128 = zext i64 %high to i128
  %high_shifted = shl i128 %high128, 64
  %state = or i128 %high_shifted, %low128
  %step_low128 = zext i64 %step_low to i128
  %step_high128 = zext i64 %step_high to i128
  %step_shifted = shl i128 %step_high128, 64
  %step = or i128 %step_shifted, %step_low128
  %product = mul i128 %state, 47026247687942121848144207491837523525
  %next = add i128 %product, %step
  %next_low = trunc i128 %next to i64
  %next_shifted = lshr i128 %next, 64
  %next_high = trunc i128 %next_shifted to i64
  store i64 %next_low, ptr %place
  store i64 %next_high, ptr %high_place
  %mixed = xor i64 %next_high, %next_low
  %turn = lshr i64 %next_high, 58
  %back = sub i64 64, %turn
  %left = and i64 %back, 63
  %down = lshr i64 %mixed, %turn
  %up = shl i64 %mixed, %left
  %word = or i64 %down, %up
  ret i64 %word
}

define i32 @evoros.next_uint32(i64 %generator) {
  %place = inttoptr i64 %generator to ptr
  %kept_place = getelementptr i64, ptr %place, i64 4
  %word_place = getelementptr i64, ptr %place, i64 5
  %kept = load i64, ptr %kept_place
  %has = icmp ne i64 %kept, 0
  br i1 %has, label %second, label %first
second:
  store i64 0, ptr %kept_place
  %word = load i64, ptr %word_place
  %half = trunc i64 %word to i32
  ret i32 %half
first:
  %both = call i64 @evoros.next_uint64(i64 %generator)
  %other = lshr i64 %both, 32
  store i64 1, ptr %kept_place
  store i64 %other, ptr %word_place
  %low = trunc i64 %both to i32
  ret i32 %low
}

define double @evoros.next_double(i64 %generator) {
  %word = call i64 @evoros.next_uint64(i64 %generator)
  %bits = lshr i64 %word, 11
  %number = uitofp i64 %bits to double
  %share = fmul double %number, 0x3CA0000000000000
  ret double %share
}
"""
